"""How does a command line become one call of a public function, and an error an exit code?

One file per command, listed in `application`; what commands share stands in `options`, `exit_codes` and `terminal`. Everything
heavy is imported inside the commands, so that ``rigsight --help`` answers at once.
"""

from __future__ import annotations

from rigsight.cli.application import app as app
from rigsight.cli.application import main as main

__all__ = ["app", "main"]
