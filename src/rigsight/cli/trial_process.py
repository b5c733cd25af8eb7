"""The process that diagnoses a blind trial: it runs the command line; its exit code distinguishes errors of the machine."""

from __future__ import annotations

from pathlib import Path

from rigsight.cli.application import main as command_line
from rigsight.cli.exit_codes import CommandExit
from rigsight.workflow.bench.parent_watch import end_with_parent
from rigsight.workflow.bench.trial import MACHINE

START = ("-c", f"from {__name__} import main; main()")
"""Arguments with which Python starts the process; defined here, so that lower packages do not import the command line."""


def main() -> None:
    """Run the command line as a child that ends, and removes its folder, when the process that started it has ended."""
    end_with_parent(str(Path.cwd()))
    try:
        command_line()
    except CommandExit as end:
        raise SystemExit(MACHINE if end.is_of_the_machine else end.code) from None
