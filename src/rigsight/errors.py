"""Every error a user can meet: what was wrong, what was got, what is allowed or what to do next."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any

LONGEST_MESSAGE = 4000
"""In characters; messages quote what files hold, and a file may hold names of any length."""
_LONGEST_VALUE = 300
# Would move the cursor or color the terminal, or could not be printed at all.
_UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff]")


class RigsightError(Exception):
    """Root of all errors that are reported to the user as one message, without a traceback."""

    def __str__(self) -> str:
        text = super().__str__()
        if len(text) > LONGEST_MESSAGE:
            half = LONGEST_MESSAGE // 2
            text = f"{text[:half]} ... {text[-half:]}"
        return _UNPRINTABLE.sub(lambda sign: ascii(sign[0])[1:-1], text)


class InputError(RigsightError, ValueError):
    """A file, an option or an argument cannot be used as it is."""


class MachineError(InputError):
    """Nothing is wrong with the input: a disk, a folder or the memory of this machine does not take what is to be kept."""


class SimulationError(RigsightError, ArithmeticError):
    """A simulation left the range of numbers, or could not reach the accuracy asked for."""


def shown(value: object) -> str:
    """Return a value as messages quote it, cut where it is long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):
        # Python writes out neither whole numbers of thousands of digits nor the deepest nests.
        text = f"a {type(value).__name__} too large to be shown"
    return text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]} ..."


def readable(name: str) -> str:
    """Return a name of a file with a sign that can be printed for each byte that is not text."""
    return "".join("\ufffd" if "\ud800" <= sign <= "\udfff" else sign for sign in name)


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Return ``" Did you mean 'x'?"`` for the closest allowed name, or an empty string."""
    matches = get_close_matches(name, list(allowed), n=1, cutoff=0.5)
    return f" Did you mean '{matches[0]}'?" if matches else ""


def check_option(what: str, value: str, allowed: Iterable[str]) -> str:
    """Return `value` if it is one of `allowed`."""
    options = sorted(allowed)
    if value in options:
        return value
    listed = ", ".join(f"'{option}'" for option in options)
    raise InputError(f"{what} is '{value}'.{nearest(value, options)} Allowed: {listed}.")


def check_in_range(what: str, value: Any, lower: float, upper: float, unit: str = "") -> float:
    """Return `value` as a float if it lies in [lower, upper]."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{what} must be a number, got {value!r}.") from None
    if not lower <= number <= upper:
        suffix = f" {unit}" if unit else ""
        raise InputError(f"{what} must lie in [{lower:g}, {upper:g}]{suffix}, got {number:g}.")
    return number


@contextmanager
def needing(what: str, package: str, extra: str) -> Iterator[None]:
    """Turn the failed import of an optional package into a message on the extra that installs it."""
    try:
        yield
    except ImportError:
        raise InputError(
            f"{what} needs {package}, which is not installed: pip install 'rigsight[{extra}]'."
        ) from None
