"""A record as a CSV file that can be read again."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np

from rigsight.records import Record
from rigsight.records.read_record import TIME
from rigsight.records.stamps import digits_for

_DIGITS = 12
_STAMPS_TO = 1e-4
"""Of the sample time: how closely time is written, so that the file is evenly sampled when it is read again."""


def csv_text(record: Record, names: Sequence[str]) -> str:
    """Return the time and the named signals of a record, under their names."""
    file = io.StringIO()
    table = np.column_stack([record.t, *(record[name] for name in names)])
    digits = [digits_for(float(record.t[-1]), _STAMPS_TO * record.dt, _DIGITS), *[_DIGITS] * len(names)]
    np.savetxt(
        file,
        table,
        fmt=[f"%.{n}g" for n in digits],
        delimiter=",",
        header=",".join([TIME, *names]),
        comments="",
    )
    return file.getvalue()
