"""The command line: each command calls one public function, and errors become exit codes.

One file per kind of command, all listed in `application`; shared code is in `options`, `exit_codes` and `terminal`.
Heavy imports are inside the commands, so that ``rigsight --help`` is fast.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rigsight.cli.application import app as app

__all__ = ["app", "main"]


def main() -> None:
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
