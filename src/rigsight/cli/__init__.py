"""The command line: each command calls one public function, and errors become exit codes.

One file per command, listed in `application`; shared code is in `options`, `exit_codes`, `signals` and `terminal`.
Heavy imports are inside the commands, so that ``rigsight --help`` is fast.
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
    """End without the interpreter's shutdown, in which LLVM crashes after an interrupted compilation."""
    from rigsight.workflow.run.results import ENDING_SIGNALS

    for number in ENDING_SIGNALS:
        # The first signal is enough; another would only print an error.
        signal.signal(number, signal.SIG_IGN)
    # Release what worker processes shared.
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
        # The parser, which reports later interruptions, is not loaded yet.
        sys.stderr.write("rigsight: interrupted.\n")
        raise SystemExit(130) from None
    application.main()


def __getattr__(name: str) -> Any:
    if name == "app":
        from rigsight.cli.application import app

        return app
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
