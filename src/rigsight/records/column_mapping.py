"""Column of a signal in a file, and its conversion to SI."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError, nearest, shown
from rigsight.records.record import Floats

TIME = "t"


@dataclass(frozen=True)
class ColumnMapping:
    """Column of a signal in a file: ``value in SI = scale * column + offset``.

    Attributes
    ----------
    name
        Name of the column or channel, or its number, counted from 1.
    scale
        SI unit per unit of the column. None uses the unit, or the one that the file states, or takes the values as they are.
    offset
        Value added after scaling or conversion of the file's unit, in the SI unit.
    unit
        Unit of the column, instead of scale and offset: ``"deg"``.
    unwrap
        True for an angle that begins again after a full turn, or the period of a counter in the numbers of the column; False for
        neither, None to find out.
    time
        Name or number of the column of its time, where signals have clocks of their own and the file does not show which.
    file
        File that holds the column, where it is another than that of the record.

    Raises
    ------
    InputError
        If the scale is zero, scale or offset is not finite, a unit stands beside them, or a period is not positive.
    """

    name: str | int
    scale: float | None = None
    offset: float | None = None
    unit: str | None = None
    unwrap: bool | float | None = None
    time: str | int | None = None
    file: Path | None = None

    def __post_init__(self) -> None:
        if self.scale is not None and (not math.isfinite(self.scale) or self.scale == 0.0):
            raise InputError(
                f"Column '{self.name}': scale must be a finite number other than 0, got {self.scale}."
            )
        if self.offset is not None and not math.isfinite(self.offset):
            raise InputError(f"Column '{self.name}': offset must be a finite number, got {self.offset}.")
        if self.unit is not None and self.is_converted:
            raise InputError(
                f"Column '{self.name}': unit = \"{self.unit}\" is combined with scale or offset, which also convert; give one of "
                "the two."
            )
        if not (self.unwrap is None or isinstance(self.unwrap, bool) or 0.0 < self.unwrap < math.inf):
            raise InputError(
                f"Column '{self.name}': unwrap must be true, false, or the numbers after which the column begins again, got "
                f"{self.unwrap}."
            )

    @property
    def is_converted(self) -> bool:
        """True if scale or offset is given."""
        return self.scale is not None or self.offset is not None

    def to_si(self, column: Floats) -> Floats:
        """Return a column in SI units, shape (n_samples,).

        Parameters
        ----------
        column
            Numbers in the file, shape (n_samples,).
        """
        return (self.scale or 1.0) * column + (self.offset or 0.0)


def checked_columns(
    file: str, columns: Mapping[str, ColumnMapping | str | int], signals: Collection[str]
) -> dict[str, ColumnMapping]:
    """Return the columns of signals as mappings."""
    checked = {}
    for signal, column in columns.items():
        if signal not in signals:
            raise InputError(
                f"{file}: columns names '{signal}', which is not a signal here.{nearest(signal, signals)} "
                f"Signals: {', '.join(signals)}."
            )
        if isinstance(column, str) or (isinstance(column, int) and not isinstance(column, bool)):
            checked[signal] = ColumnMapping(column)
        elif isinstance(column, ColumnMapping):
            checked[signal] = column
        else:
            raise InputError(
                f"{file}: the column of {signal} must be its name, its number counted from 1, or a ColumnMapping; "
                f"got {shown(column)}."
            )
    return checked


@dataclass(frozen=True, eq=False)
class Columns:
    """Numbers of a file before scale and offset."""

    # Signal name -> column, shape (n_samples,); all finite. Without time where `axes` has it.
    values: Mapping[str, Floats]
    labels: Mapping[str, str]  # signal name -> name of the column in the file
    lines: NDArray[np.int64]  # number of every row for messages, shape (n_samples,)
    notes: tuple[str, ...] = ()  # assumptions made while reading
    # Signal name -> unit stated in a dedicated field of the file.
    units: Mapping[str, str] = field(default_factory=dict)
    # Signal name -> time stamps, shape (n_samples,), where the signals do not share one axis; else empty. In
    # the unit of time.
    axes: Mapping[str, Floats] = field(default_factory=dict)
    # Signal name -> how its time is called, where `axes` has it.
    clocks: Mapping[str, str] = field(default_factory=dict)
    row: str = "line"  # name of a row in messages: ``"line"`` of a text, ``"sample"`` otherwise
    names: tuple[str, ...] = ()  # names of all columns in the file
    # Signal name -> moment from which its time counts, where the file says so.
    origins: Mapping[str, np.datetime64] = field(default_factory=dict)
    # Time [s] by which signals may be late against each other, as far as the file can tell.
    clock_uncertainty: float = 0.0

    @property
    def stamps(self) -> Mapping[str, Floats]:
        """Time stamps of each signal where they do not share one axis, else of time itself; shape (n_samples,) each."""
        return self.axes or {TIME: self.values[TIME]}

    def clock_of(self, signal: str) -> Floats:
        """Return the time stamps of a signal, shape (n_samples,)."""
        return self.axes[signal] if self.axes else self.values[TIME]
