"""What results from Python share: an item chosen by name, and tables of pandas, which is optional and loaded when used."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from rigsight.errors import InputError, check_option

if TYPE_CHECKING:
    import pandas as pd

T = TypeVar("T")


def named(what: str, name: str | None, known: Mapping[str, T]) -> T:
    """Return the item with this name, the first one for None."""
    if not known:
        raise InputError(f"The result contains no {what} to show.")
    return next(iter(known.values())) if name is None else known[check_option(f"The {what}", name, known)]


def check_unused(needed: str, picture: str, **given: str | None) -> None:
    """Refuse choices that only the picture `needed` shows; those not made are None."""
    chosen = [name for name, value in given.items() if value is not None]
    if chosen and picture != needed:
        raise InputError(
            f"{' and '.join(chosen)} can be chosen only for the picture '{needed}', not for '{picture}'. Leave it out."
        )


def data_frame(rows: Iterable[Mapping[str, Any]], columns: Iterable[str]) -> pd.DataFrame:
    """Return rows as a table with these columns first, in their order; columns that only some rows have follow."""
    try:
        import pandas as pd
    except ImportError:
        raise InputError(
            'Tables need pandas, which is not installed: pip install "rigsight[notebook]"'
        ) from None
    found = [dict(row) for row in rows]
    names = dict.fromkeys([*columns, *(name for row in found for name in row)])
    return pd.DataFrame(found, columns=list(names))
