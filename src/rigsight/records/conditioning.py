"""Which even clock do the time stamps of a record stand for, how far do they wander from it, and where are samples missing?

The motion in a gap is unknown, so nothing is interpolated: a stretch between gaps is a record with an initial state of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.column_mapping import ColumnMapping, Columns
from rigsight.records.record import Floats
from rigsight.records.signals import is_constant
from rigsight.records.stamps import written_span, written_stamp

FEWEST_SAMPLES = 50
# Beyond, squares and quotients would overflow; data read with a wrong type looks like this.
LARGEST_NUMBER = 1e100
SHORTEST_TIME = 1e-100
# Of the sample time: below, interpolation adds more error than it mends.
NEGLIGIBLE_JITTER = 1e-4
# Of the sample time: loops of measured rigs reach 1.6; a longer step hides more than two samples, too many to interpolate.
LARGEST_JITTER = 2.0
# Of the sample time: with stamps printed more coarsely, rounding cannot be told from a repeated or missing row; up to the second,
# a whole step missing is still twice what rounding does.
COARSEST_STAMPS, COARSE_BUT_CLEAR = 0.2, 0.5
# Of the typical step, beside what steps vary anyway: the middle between no sample missing and one.
LEAST_PAUSE = 1.5
# Of the steps: more long ones are jitter; the others show how much steps vary anyway.
MOST_PAUSES = 0.05
# Of the typical step: lost samples lengthen a step by whole ones, a late program by any share.
_WHOLE = 0.02
# Share of the samples that must be left in stretches that are long enough: else a record is not cut.
FEWEST_KEPT = 0.5
# Of the printed resolution: a half, and a little for the fitted grid.
LARGEST_ROUNDING = 0.6
STAMPS_LOOKED_AT = 3000
# Relative error that the least squares line leaves on a sample time.
ARITHMETIC = 1e-13


@dataclass(frozen=True, eq=False)
class TimeBase:
    """The even grid of a record."""

    # First stamp and sample time, in the unit of the stamps.
    t0: float
    dt: float
    n_samples: int  # number of stamps
    # Measured stamps, shape (n_samples,), where the samples must be resampled; None where they lie on the
    # grid.
    stamps: Floats | None = None
    # Of these stamps, as a share of `dt`: how far they, or the steps between them, are from even at most.
    jitter: float = 0.0
    n_far: int = 0  # how many steps are from even by more than half of that
    notes: tuple[str, ...] = ()  # what was assumed

    @property
    def end(self) -> float:
        """The last stamp."""
        return self.t0 + self.dt * (self.n_samples - 1) if self.stamps is None else float(self.stamps[-1])

    def times(self) -> Floats:
        """Return the stamps, shape (n_samples,)."""
        if self.stamps is not None:
            return self.stamps
        return self.t0 + self.dt * np.arange(self.n_samples, dtype=np.float64)

    def in_seconds(self, time: ColumnMapping) -> TimeBase:
        """Return the grid in seconds, of stamps in the unit of a column of time."""
        stamps = None if self.stamps is None else time.to_si(self.stamps)
        start, scale = float(time.to_si(np.array(self.t0))), time.scale or 1.0
        return replace(self, t0=start, dt=scale * self.dt, stamps=stamps)


def check_long_enough(file: str, n_samples: int) -> None:
    """Raise InputError for a file with too few samples for a record."""
    if n_samples < FEWEST_SAMPLES:
        raise InputError(
            f"{file} has {n_samples} samples; at least {FEWEST_SAMPLES} are needed for a record."
        )


def time_base(stamps: Floats, lines: NDArray[np.int64], file: str, row: str = "line") -> TimeBase:
    """Return the even grid of the time stamps."""
    check_long_enough(file, stamps.size)
    span = abs(stamps[-1] - stamps[0])
    if not (span == 0.0 or span >= SHORTEST_TIME) or not np.max(np.abs(stamps)) <= LARGEST_NUMBER:
        raise InputError(
            f"{file}: time runs from {stamps[0]:.6g} to {stamps[-1]:.6g}, which is implausible. Check the column "
            "that time is read from, and its type."
        )
    index = np.arange(stamps.size, dtype=np.float64)
    slope, start = np.polyfit(index, stamps - stamps[0], 1)
    deviation = np.abs(stamps - stamps[0] - start - slope * index)
    rounding = resolution(stamps)
    coarse = bool(rounding.max() > COARSEST_STAMPS * slope)
    tolerated = np.full(stamps.size, NEGLIGIBLE_JITTER * slope)
    if not coarse:
        tolerated = np.maximum(tolerated, LARGEST_ROUNDING * rounding)
    if slope > 0.0 and bool(np.all(deviation <= tolerated)):
        even = _plain(float(slope), float(rounding[-1]) / stamps.size)
        return TimeBase(float(stamps[0]), even, stamps.size)
    _check_order(stamps, lines, file, row)
    _check_gaps(stamps, lines, file, row)
    steps = np.diff(stamps)
    dt = float((stamps[-1] - stamps[0]) / (stamps.size - 1))
    # A clock that wanders keeps its steps even but not its stamps; scattered stamps the other way round.
    jitter = min(float(deviation.max()) / float(slope), float(np.abs(steps - dt).max()) / dt)
    if jitter > LARGEST_JITTER:
        worst = int(np.argmax(np.abs(steps - dt)))
        raise InputError(
            f"{file}, {row} {lines[worst + 1]}: the samples are not equally spaced; the step to "
            f"t = {stamp_text(stamps, worst + 1)} is {steps[worst]:.4g}, the mean step {dt:.4g} "
            f"(jitter {100 * jitter:.2g} %, at most {100 * LARGEST_JITTER:g} % is resampled). "
            "Record with a fixed sample time, or cut the record to its even part with start and end. Of events, such as one a "
            "turn of a shaft, interpolate the reading on even times before."
        )
    agrees = bool(np.all(deviation <= LARGEST_ROUNDING * rounding))
    if agrees and COARSEST_STAMPS < rounding.max() / slope <= COARSE_BUT_CLEAR:
        note = (
            f"{file}: time is printed in steps of {rounding.max():.2g}, coarse beside the sample time of {dt:.4g}; the samples "
            "were taken as evenly spaced, which agrees with every stamp."
        )
        even = _plain(slope, float(rounding[-1]) / stamps.size)
        return TimeBase(float(stamps[0] + start), even, stamps.size, notes=(note,))
    even = _plain(dt, jitter * dt / stamps.size)
    # From the median, as one jump moves the mean of all others.
    n_far = int(np.count_nonzero(np.abs(steps - np.median(steps)) > 0.5 * jitter * dt))
    return TimeBase(float(stamps[0]), even, stamps.size, stamps, jitter, n_far)


def stamp_text(stamps: Floats, sample: int) -> str:
    """Return a stamp as text that tells it from its neighbors."""
    steps = np.abs(np.diff(stamps))
    finest = float(np.min(steps[steps > 0.0], initial=np.inf))
    return written_stamp(float(stamps[sample]), max(finest, 1e-3 * float(np.median(steps))), fewest=9)


def pauses(stamps: Floats) -> NDArray[np.intp]:
    """Return the samples after which others are missing; none where steps vary (jitter)."""
    # A step is a gap if it is longer than the others vary by at least half a sample, if it is longer by whole samples (or by more
    # than `LARGEST_JITTER`), and if the clock does not catch up behind it. Where too little would be left between gaps
    # short enough to be interpolated, there are none.
    none, steps = np.zeros(0, dtype=np.intp), np.diff(stamps)
    if steps.size == 0 or np.any(steps <= 0.0):
        return none
    in_samples = steps / float(np.median(steps))
    varies = float(np.quantile(np.abs(in_samples - 1.0), 1.0 - MOST_PAUSES))
    found = np.flatnonzero(in_samples > LEAST_PAUSE + 2.0 * varies)
    longest = 1.0 + LARGEST_JITTER + _WHOLE
    off_whole = np.abs(in_samples[found] - np.round(in_samples[found]))
    found = found[(off_whole <= max(_WHOLE, 2.0 * varies)) | (in_samples[found] > longest)]
    missed = [_stands_out(steps, int(i)) and _is_missed(stamps, int(i)) for i in found]
    found = found[np.array(missed, dtype=bool)]
    if found.size == 0 or found.size > MOST_PAUSES * steps.size:
        return none
    lengths = np.diff([0, *(found + 1), stamps.size])
    too_little = lengths[lengths >= FEWEST_SAMPLES].sum() < FEWEST_KEPT * stamps.size
    return none if too_little and bool(np.all(in_samples <= longest)) else found


def _stands_out(steps: Floats, sample: int) -> bool:
    """Return False if the steps around a long one have grown to it, as those of one event a turn of a shaft that slows down."""
    near = np.r_[steps[max(0, sample - 2) : sample], steps[sample + 1 : sample + 3]]
    return bool(steps[sample] > LEAST_PAUSE * np.median(near))


def _is_missed(stamps: Floats, sample: int) -> bool:
    """Return False if the stamps behind a long step are where they would be without it: one was only late."""
    step, near = float(np.median(np.diff(stamps))), 10
    before = stamps[max(0, sample - near) : sample + 1]
    after = stamps[sample + 1 : sample + 1 + near]
    expected = float(np.median(before - step * np.arange(1 - before.size, 1)))
    found = float(np.median(after - step * np.arange(1, after.size + 1)))
    return found - expected > 0.5 * step


def missing_behind(stamps: Floats, sample: int) -> int:
    """Return how many samples are missing behind one."""
    return round(float(stamps[sample + 1] - stamps[sample]) / float(np.median(np.diff(stamps)))) - 1


def resolution(stamps: Floats) -> Floats:
    """Return the spacing of the numbers that the file's digits can express at each stamp, shape (n_samples,)."""
    # Files print either a fixed number of decimals or of significant digits; the coarser of both explains a stamp's rounding.
    chosen = np.unique(np.linspace(0, stamps.size - 1, STAMPS_LOOKED_AT).astype(np.int64))
    digits = [_digits(float(stamp)) for stamp in stamps[chosen]]
    decimals = max(after_point for _, after_point in digits)
    significant = max(count for count, _ in digits)
    # Damaged stamps may have more decimals than numbers have room for.
    last_decimal = max(10.0**-decimals, float(np.finfo(np.float64).tiny))
    magnitude = np.floor(np.log10(np.maximum(np.abs(stamps), last_decimal))) + 1.0
    return np.asarray(np.maximum(last_decimal, 10.0 ** (magnitude - significant)), dtype=np.float64)


def _digits(number: float) -> tuple[int, int]:
    """Return the counts of significant digits and of decimals in the shortest text that gives the number."""
    mantissa, _, exponent = f"{number!r}".lower().lstrip("-").partition("e")
    whole, _, fraction = mantissa.partition(".")
    fraction = fraction.rstrip("0")
    return len((whole + fraction).lstrip("0")), max(len(fraction) - int(exponent or 0), 0)


def _plain(dt: float, uncertainty: float) -> float:
    """Return `dt` with as few digits as stay within the uncertainty that rounding leaves on it."""
    uncertainty = max(uncertainty, ARITHMETIC * dt)
    for n_digits in range(2, 16):
        rounded = float(f"{dt:.{n_digits}g}")
        if abs(rounded - dt) <= 0.5 * uncertainty:
            return rounded
    return dt


def _check_order(stamps: Floats, lines: NDArray[np.int64], file: str, row: str) -> None:
    steps = np.diff(stamps)
    if np.all(steps > 0.0):
        return
    first = int(np.argmax(steps <= 0.0))
    where = f"{file}, {row} {lines[first + 1]}: "
    if steps[first] < 0.0:
        raise InputError(
            f"{where}time is not increasing: {stamp_text(stamps, first + 1)} follows {stamp_text(stamps, first)}. "
            "Sort the rows, or split the file where a new record begins."
        )
    count = int(np.count_nonzero(steps == 0.0))
    remedy = "Write the time with more digits." if count > stamps.size // 10 else "Delete the repeated row."
    raise InputError(
        f"{where}duplicate time stamp {stamp_text(stamps, first)} ({count} in the file). {remedy}"
    )


def _check_gaps(stamps: Floats, lines: NDArray[np.int64], file: str, row: str) -> None:
    """Refuse missing samples."""
    gaps = pauses(stamps)
    if gaps.size == 0:
        return
    first = int(gaps[0])
    more = f" ({gaps.size} gaps in the file)" if gaps.size > 1 else ""
    raise InputError(
        f"{file}, between {row}s {lines[first]} and {lines[first + 1]}: {missing_behind(stamps, first)} samples are "
        f"missing, the time jumps from {stamp_text(stamps, first)} to {stamp_text(stamps, first + 1)}{more}. "
        "Split the record there into two files."
    )


def between(
    file: str, table: Columns, scale: ColumnMapping, start: float | None, end: float | None
) -> Columns:
    """Return the rows of a table from `start` to `end`."""
    begin, stop = (-np.inf if start is None else start), (np.inf if end is None else end)
    seconds = [scale.to_si(stamps) for stamps in table.stamps.values()]
    first, last = min(float(t.min()) for t in seconds), max(float(t.max()) for t in seconds)
    if not begin < stop or begin > last or stop < first:
        asked = f"start = {begin:g}, end = {stop:g}"
        raise InputError(
            f"{file}: {asked} is no stretch of the record, whose time runs from {written_span(first, last)}."
        )
    return _cut(table, lambda stamps: _within(begin, stop, scale.to_si(stamps)))


def stretches(
    file: str, table: Columns, outputs: Sequence[str]
) -> tuple[tuple[Columns, ...], tuple[str, ...]]:
    """Return a table split at the gaps of its clocks, whole if there are none, and where it was cut and what was left out."""
    clocks = table.stamps
    gaps = {signal: found for signal, stamps in clocks.items() if (found := _gaps(stamps)).size}
    if not gaps:
        return (table,), ()
    # The clock with the most gaps is the one that is told; all others end there as well.
    worst = max(gaps, key=lambda signal: gaps[signal].size)
    stamps, ends = clocks[worst], gaps[worst]
    pauses_of_all = [(clocks[s][end], clocks[s][end + 1]) for s, found in gaps.items() for end in found]
    edges = sorted({(float(before), float(after)) for before, after in pauses_of_all})
    spans, latest = [], -np.inf
    for before, after in edges:
        spans.append((latest, before))
        latest = max(latest, after)
    spans = [(begin, stop) for begin, stop in [*spans, (latest, np.inf)] if begin < stop]
    parts = [_cut(table, partial(_within, begin, stop)) for begin, stop in spans]
    parts = [part for part in parts if min(map(np.size, part.values.values())) > 1]
    long = [part for part in parts if part.lines.size >= FEWEST_SAMPLES]
    moving = [part for part in long if not (outputs and all(is_constant(part.values[o]) for o in outputs))]
    where = _where(stamps, table, ends)
    n_samples = max(stamps.size for stamps in clocks.values())
    kept = sum(part.lines.size for part in moving)
    if kept < FEWEST_KEPT * n_samples:
        raise InputError(
            f"{file}: samples are missing {where}. Only {kept} of {n_samples} samples lie in stretches of {FEWEST_SAMPLES} or "
            "more in which an output changes. Record without dropouts, or fill them before reading if you know what was there."
        )
    dropped = n_samples - kept
    why = "shorter stretches"
    if len(moving) < len(long):
        why = "stretches that are shorter, or in which no output changes,"
    left = f" {dropped} samples in {why} were left out." if dropped > 0 else ""
    note = (
        f"{file}: samples are missing {where}. It was read as {len(moving)} record{'s' if len(moving) > 1 else ''}, each with "
        f"its own initial state; nothing was interpolated.{left}"
    )
    return tuple(moving), (note,)


def _gaps(stamps: Floats) -> NDArray[np.intp]:
    """Return the samples after which others are missing, see `pauses`; none where jumps may come from rounding to the digits."""
    none = np.zeros(0, dtype=np.intp)
    found = pauses(stamps) if stamps.size >= FEWEST_SAMPLES else none
    if found.size == 0:
        return none
    digits, index = resolution(stamps), np.arange(stamps.size, dtype=np.float64)
    if np.max(digits) <= COARSEST_STAMPS * float(np.median(np.diff(stamps))):
        return found
    deviation = np.abs(stamps - np.polyval(np.polyfit(index, stamps, 1), index))
    return none if np.all(deviation <= LARGEST_ROUNDING * digits) else found


def _where(stamps: Floats, table: Columns, ends: NDArray[np.intp]) -> str:
    """Return the location of the first gap and the number of gaps."""
    first = int(ends[0])
    others = "" if ends.size == 1 else f", and at {ends.size - 1} more place{'s' if ends.size > 2 else ''}"
    return (
        f"between {table.row}s {table.lines[first]} and {table.lines[first + 1]} ({missing_behind(stamps, first)}; the time "
        f"jumps from {stamp_text(stamps, first)} to {stamp_text(stamps, first + 1)}){others}"
    )


def _within(begin: float, stop: float, stamps: Floats) -> NDArray[np.bool_]:
    return np.asarray((stamps >= begin) & (stamps <= stop))


def _cut(table: Columns, inside: Callable[[Floats], NDArray[np.bool_]]) -> Columns:
    """Return the rows of a table whose stamps lie inside, of each signal by its own clock."""
    rows = {id(stamps): np.flatnonzero(inside(stamps)) for stamps in table.stamps.values()}
    of = {name: rows[id(table.clock_of(name))] for name in table.values}
    axes = {id(stamps): stamps[rows[id(stamps)]] for stamps in table.axes.values()}
    return replace(
        table,
        values={name: samples[of[name]] for name, samples in table.values.items()},
        axes={name: axes[id(stamps)] for name, stamps in table.axes.items()},
        lines=table.lines[max(rows.values(), key=np.size)],
    )
