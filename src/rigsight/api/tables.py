"""Results as pandas tables; pandas is optional and only loaded when used."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from rigsight.errors import InputError

if TYPE_CHECKING:
    import pandas as pd


def data_frame(rows: Iterable[Mapping[str, Any]], columns: Iterable[str]) -> pd.DataFrame:
    """Return rows as a table with these columns first, in their order; columns that only some rows have follow.

    Parameters
    ----------
    rows
        Column -> value of each row.
    columns
        Names of the columns that a table without rows has as well.

    Raises
    ------
    InputError
        If pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError:
        raise InputError(
            'Tables need pandas, which is not installed: pip install "rigsight[notebook]"'
        ) from None
    found = [dict(row) for row in rows]
    names = dict.fromkeys([*columns, *(name for row in found for name in row)])
    return pd.DataFrame(found, columns=list(names))
