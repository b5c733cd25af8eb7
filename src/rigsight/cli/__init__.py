"""How does a command line become one call of a public function, and an error an exit code?

One file per command, listed in `application`; what commands share stands in `options`, `exit_codes`, `signals` and `terminal`.
Everything heavy is imported inside the commands, so that ``rigsight --help`` answers at once.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import sys
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from rigsight.cli.application import app as app

__all__ = ["app", "main"]

_INTERRUPTED = (129, 130, 143)


def main() -> None:
    """Run the command line as a process of its own."""
    try:
        command_line()
    except SystemExit as end:
        if end.code in _INTERRUPTED:
            _end_at_once(end.code)
        raise


def _end_at_once(code: int) -> NoReturn:
    """End without taking the interpreter apart: what an interrupted compilation leaves of LLVM crashes there."""
    from rigsight.workflow.run.results import ENDING_SIGNALS

    for number in ENDING_SIGNALS:
        # One is enough: another would only complain.
        signal.signal(number, signal.SIG_IGN)
    # What worker processes shared is given back.
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            stream.flush()
    os._exit(code)


def command_line() -> None:
    """Run the command line and leave with SystemExit."""
    try:
        from rigsight.cli import application
    except KeyboardInterrupt:
        # The parser is not there yet, which tells later interruptions.
        sys.stderr.write("rigsight: interrupted.\n")
        raise SystemExit(130) from None
    application.main()


def __getattr__(name: str) -> Any:
    if name == "app":
        from rigsight.cli.application import app

        return app
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
