"""How does a process that diagnoses a blind trial run the command line, and say whether the trial or the machine ended it?"""

from __future__ import annotations

from pathlib import Path

from rigsight.cli.application import main as command_line
from rigsight.cli.exit_codes import CommandExit
from rigsight.workflow.bench.parent_watch import end_with_parent
from rigsight.workflow.bench.trial import MACHINE

START = ("-c", f"from {__name__} import main; main()")
"""Arguments with which Python starts the process; it is named here, so that nothing below names the command line."""


def main() -> None:
    """Run the command line as a child that ends, and clears its folder, with the process that started it."""
    end_with_parent(str(Path.cwd()))
    try:
        command_line()
    except CommandExit as end:
        raise SystemExit(MACHINE if end.is_of_the_machine else end.code) from None
