"""Choice of one of several items by name, and which choices a picture leaves no room for."""

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


def check_unused(needed: str, picture: str, **given: str | None) -> None:
    """Refuse choices that only one picture shows.

    Parameters
    ----------
    needed
        That picture.
    picture
        The one asked for.
    **given
        The choices by name; None where none was made.

    Raises
    ------
    InputError
        If a choice was made for another picture.
    """
    chosen = [name for name, value in given.items() if value is not None]
    if chosen and picture != needed:
        raise InputError(
            f"{' and '.join(chosen)} can be chosen only for the picture '{needed}', not for '{picture}'. Leave it out."
        )
