"""The command ``rigsight blind`` is in the package `rigsight_bench`; where that is missing, the command says how to get it."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec

from rigsight.cli.exit_codes import report_errors
from rigsight.errors import InputError

_BENCH = "rigsight_bench"
REFUSES = {"allow_extra_args": True, "ignore_unknown_options": True}
"""Settings of a command that ends with the same message whatever its options are."""


def blind_command() -> Callable[..., None]:
    """Return the command of the bench, or `not_installed`."""
    if find_spec(_BENCH) is None:
        return not_installed
    command: Callable[..., None] = import_module(f"{_BENCH}.command").blind
    return command


def not_installed() -> None:
    """Diagnose trials whose true effect is withheld, and score the verdicts: needs 'pip install ./bench'.

    The blind bench is a package of its own, rigsight-bench, in the folder bench/ of rigsight's repository.
    """
    with report_errors(debug=False):
        raise InputError(
            "The blind bench is a package of its own, rigsight-bench, which is not installed. "
            "In a copy of rigsight's repository: pip install ./bench"
        )
