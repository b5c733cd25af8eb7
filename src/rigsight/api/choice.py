"""Choice of one of several items by name; the first if no name is given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from rigsight.errors import InputError, check_option

T = TypeVar("T")


def named(what: str, name: str | None, known: Mapping[str, T]) -> T:
    """Return the item with this name, the first one for None.

    Parameters
    ----------
    what
        Kind of item, for messages.
    name
        Its name, or None.
    known
        All there are, by name.

    Raises
    ------
    InputError
        If there is none, or none of this name.
    """
    if not known:
        raise InputError(f"The result contains no {what} to show.")
    return next(iter(known.values())) if name is None else known[check_option(f"The {what}", name, known)]
