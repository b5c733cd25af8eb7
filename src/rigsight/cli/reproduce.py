"""The command ``rigsight reproduce``."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import show, show_files, show_json, table
from rigsight.errors import InputError

if TYPE_CHECKING:
    from rich.console import Group

    from rigsight.workflow.reproduce import Reproduction

NOT_THE_SAME = 1


def reproduce(
    report: Annotated[Path, typer.Argument(metavar="REPORT", help="The report.html of a diagnosis.")],
    out: options.ResultsFolder = Path("reproduction"),
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Run the diagnosis of a report again and say whether it says the same; exit code 1 where it does not.

    Writes the new results and reproduction.json into DIR.
    """
    with report_errors(debug):
        from rigsight.workflow.reproduce import REPRODUCTION_FILE, run_reproduce

        def run(arguments: Sequence[str], folder: Path) -> None:
            if not folder.is_dir():
                raise InputError(f"{folder}, the folder in which the report was made, does not exist.")
            done = subprocess.run(
                [sys.executable, "-m", "rigsight", *arguments, "--quiet"], cwd=folder, check=False
            )
            if done.returncode:
                raise InputError("The diagnosis of the report could not be repeated; the message is above.")

        found = run_reproduce(report, out, run)
    if json:
        show_json(out / REPRODUCTION_FILE)
    elif not quiet:
        show(_summary(found))
        show_files({"Results": out / REPRODUCTION_FILE})
    if not found.is_same:
        raise typer.Exit(NOT_THE_SAME)


def _summary(found: Reproduction) -> Group:
    from rich.console import Group

    if found.is_same:
        words = "The same inputs give the same results."
    elif found.changed_inputs:
        words = f"Not run: these inputs are missing or changed: {', '.join(found.changed_inputs)}."
    else:
        words = "The same inputs give other results."
    rows = [(f"version of {name}", *pair) for name, pair in found.versions.items()]
    rows += [(one.key, f"{one.reported}", f"{one.found}") for one in found.differences]
    return Group(words, *([table(("", "Report", "Now"), rows)] if rows else []))
