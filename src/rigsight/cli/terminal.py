"""The command line as typed, and the output of finished commands on the terminal."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table


def command_line() -> str:
    """Return the command as typed, so that results can quote it."""
    return shlex.join(["rigsight", *sys.argv[1:]])


def show(summary: RenderableType) -> None:
    """Show the summary of a result on stdout."""
    from rich.console import Console

    Console(highlight=False).print(summary)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Return a table whose heads and cells are shown as they are written."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    made = Table(*map(escape, heads), box=box.SIMPLE)
    for row in rows:
        made.add_row(*map(escape, row))
    return made


def show_json(file: Path) -> None:
    """Print a JSON file that was written, unchanged, on stdout."""
    typer.echo(file.read_text(encoding="utf-8").rstrip("\n"))


def show_as_json(content: Mapping[str, Any]) -> None:
    """Print content as JSON on stdout; `schema_version` comes first."""
    from rigsight.workflow.run.results import json_text

    typer.echo(json_text({"schema_version": 1, **content}), nl=False)


def show_files(files: Mapping[str, Path]) -> None:
    """Print an empty line, then the paths of results with a label each, aligned."""
    typer.echo()
    width = max(map(len, files)) + 1
    for label, path in files.items():
        typer.echo(f"{label + ':':{width}} {path}")
