"""How does a command line become one call of a public function, and an error an exit code?

One file per command, listed in `application`; what commands share stands in `options`, `exit_codes`, `signals` and `terminal`.
Everything heavy is imported inside the commands, so that ``rigsight --help`` answers at once.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rigsight.cli.application import app as app

__all__ = ["app", "main"]


def main() -> None:
    """Run the command line."""
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
