"""The process that diagnoses a blind trial: it runs the command line; its exit code distinguishes errors of the machine."""

from __future__ import annotations

from pathlib import Path

import rigsight
from rigsight.cli.application import main as command_line
from rigsight.cli.exit_codes import CommandExit
from rigsight_bench.running.parent_watch import end_with_parent
from rigsight_bench.running.trial import MACHINE

_PLACES = [str(Path(file).parents[1]) for file in (rigsight.__file__, __file__)]
START = (
    "-c",
    f"import sys; sys.path[:0] = [place for place in {_PLACES} if place not in sys.path]; from {__name__} import main; main()",
)
"""Arguments with which Python starts the process, which then has the code of this one, wherever that is.

Defined here, so that lower packages do not import the command line.
"""


def main() -> None:
    """Run the command line as a child that ends, and removes its folder, when the process that started it has ended."""
    end_with_parent(str(Path.cwd()))
    try:
        command_line()
    except CommandExit as end:
        raise SystemExit(MACHINE if end.is_of_the_machine else end.code) from None
