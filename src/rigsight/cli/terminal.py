"""What does a command read back from the terminal, and what does it show there when it has finished?"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from rich.console import RenderableType


def command_line() -> str:
    """Return the command as typed, so that a result can say what repeats it."""
    return shlex.join(["rigsight", *sys.argv[1:]])


def show(summary: RenderableType) -> None:
    """Show the summary of a result on stdout."""
    from rich.console import Console

    Console(highlight=False).print(summary)


def show_json(file: Path) -> None:
    """Show a JSON file that was written, as it is, on stdout."""
    typer.echo(file.read_text(encoding="utf-8").rstrip("\n"))


def show_as_json(content: Mapping[str, Any]) -> None:
    """Show content as JSON on stdout; `schema_version` comes first."""
    from rigsight.workflow.run.results import json_text

    typer.echo(json_text({"schema_version": 1, **content}), nl=False)


def show_files(files: Mapping[str, Path]) -> None:
    """Show, after an empty line, where results lie: a label and a path each, paths below each other."""
    typer.echo()
    width = max(map(len, files)) + 1
    for label, path in files.items():
        typer.echo(f"{label + ':':{width}} {path}")
