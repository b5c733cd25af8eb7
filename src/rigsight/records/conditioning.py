"""Check for equally spaced samples, and resampling of nearly equal ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.record import Hold
from rigsight.records.stamps import written_stamp

FEWEST_SAMPLES = 50
# Beyond, squares and quotients would overflow; data read with a wrong type looks like this.
LARGEST_NUMBER = 1e100
SHORTEST_TIME = 1e-100
# Of the sample time: above the first a record is refused; below the second interpolation adds more error than it mends.
LARGEST_JITTER = 0.01
NEGLIGIBLE_JITTER = 1e-4
# Of the sample time: with stamps printed more coarsely, rounding cannot be told from a repeated or missing row.
COARSEST_STAMPS = 0.2
# Of the typical step: from here on a sample at least is missing. Of the steps: more long ones are jitter.
LEAST_PAUSE = 1.5
MOST_PAUSES = 0.05
# Of the printed resolution: a half, and a little for the fitted grid.
LARGEST_ROUNDING = 0.6
STAMPS_LOOKED_AT = 3000
# Relative error that the least squares line leaves on a sample time.
ARITHMETIC = 1e-13


@dataclass(frozen=True, eq=False)
class TimeBase:
    """The even grid of a record.

    Attributes
    ----------
    t0, dt
        First stamp and sample time, in the unit of the stamps.
    stamps
        Measured stamps, shape (n_samples,), where the samples must be resampled; None where they lie on the grid.
    notes
        What was found.
    """

    t0: float
    dt: float
    stamps: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()

    def resample(self, samples: NDArray[np.float64], hold: Hold | None = None) -> NDArray[np.float64]:
        """Return samples on the even grid, shape (n_samples,).

        An input is interpolated according to its `hold`; None is an output, smooth by nature.
        """
        if self.stamps is None or hold == "zoh":
            return samples
        grid = np.linspace(self.stamps[0], self.stamps[-1], self.stamps.size)
        if hold == "foh":
            return np.interp(grid, self.stamps, samples)
        # Slow to load, and every process that reads a file apart would wait for it.
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(self.stamps, samples)(grid), dtype=np.float64)


def check_long_enough(file: str, n_samples: int) -> None:
    """Raise InputError for a file with too few samples for a record.

    Parameters
    ----------
    file
        Name for messages.
    n_samples
        What it has.
    """
    if n_samples < FEWEST_SAMPLES:
        raise InputError(
            f"{file} has {n_samples} samples; at least {FEWEST_SAMPLES} are needed for a record."
        )


def time_base(
    stamps: NDArray[np.float64], lines: NDArray[np.int64], file: str, row: str = "line"
) -> TimeBase:
    """Return the even grid of the time stamps.

    Parameters
    ----------
    stamps
        Time stamps in the file, shape (n_samples,).
    lines
        Line number of every stamp, shape (n_samples,).
    file
        Name for messages.
    row
        Name of a row in messages.

    Raises
    ------
    InputError
        Naming the line: too few samples, time not increasing, duplicate stamps, gaps, or jitter above 1 %.
    """
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
        return TimeBase(float(stamps[0]), _plain(float(slope), float(rounding[-1]) / stamps.size))
    _check_order(stamps, lines, file, row)
    _check_gaps(stamps, lines, file, row)
    steps = np.diff(stamps)
    dt = float((stamps[-1] - stamps[0]) / (stamps.size - 1))
    # A clock that wanders keeps its steps even but not its stamps; scattered stamps the other way round.
    jitter = min(float(deviation.max()) / float(slope), float(np.abs(steps - dt).max()) / dt)
    if jitter > LARGEST_JITTER:
        worst = int(np.argmax(np.abs(steps - dt)))
        mend = (
            "Write the time with more digits."
            if coarse
            else "Resample the record onto an even grid, or record with a fixed sample time."
        )
        raise InputError(
            f"{file}, {row} {lines[worst + 1]}: the samples are not equally spaced; the step to "
            f"t = {told_stamp(stamps, worst + 1)} is {steps[worst]:.4g}, the mean step {dt:.4g} "
            f"(jitter {100 * jitter:.2g} %, at most 1 % is resampled). "
            f"{mend}"
        )
    note = f"{file}: time stamps jitter by {100 * jitter:.2g} % of the sample time; samples were interpolated onto an even grid."
    return TimeBase(float(stamps[0]), dt, stamps, (note,))


def told_stamp(stamps: NDArray[np.float64], sample: int) -> str:
    """Return a stamp as text that tells it from its neighbors.

    Parameters
    ----------
    stamps
        Time stamps, shape (n_samples,).
    sample
        Which of them.
    """
    steps = np.abs(np.diff(stamps))
    finest = float(np.min(steps[steps > 0.0], initial=np.inf))
    return written_stamp(float(stamps[sample]), max(finest, 1e-3 * float(np.median(steps))), fewest=9)


def pauses(stamps: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the samples after which others are missing; none if the steps vary everywhere (jitter).

    Parameters
    ----------
    stamps
        Time stamps, shape (n_samples,).
    """
    steps = np.diff(stamps)
    if steps.size == 0 or np.any(steps <= 0.0):
        return np.zeros(0, dtype=np.intp)
    found = np.flatnonzero(steps > LEAST_PAUSE * float(np.median(steps)))
    return found if found.size <= MOST_PAUSES * steps.size else np.zeros(0, dtype=np.intp)


def missing_behind(stamps: NDArray[np.float64], sample: int) -> int:
    """Return how many samples are missing behind one."""
    return round(float(stamps[sample + 1] - stamps[sample]) / float(np.median(np.diff(stamps)))) - 1


def resolution(stamps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the spacing of the numbers that the file's digits can express at each stamp, shape (n_samples,).

    Files print either a fixed number of decimals or of significant digits; the coarser of both explains a stamp's rounding.
    """
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


def _check_order(stamps: NDArray[np.float64], lines: NDArray[np.int64], file: str, row: str) -> None:
    steps = np.diff(stamps)
    if np.all(steps > 0.0):
        return
    first = int(np.argmax(steps <= 0.0))
    where = f"{file}, {row} {lines[first + 1]}: "
    if steps[first] < 0.0:
        raise InputError(
            f"{where}time is not increasing: {told_stamp(stamps, first + 1)} follows {told_stamp(stamps, first)}. "
            "Sort the rows, or split the file where a new record begins."
        )
    count = int(np.count_nonzero(steps == 0.0))
    mend = "Write the time with more digits." if count > stamps.size // 10 else "Delete the repeated row."
    raise InputError(f"{where}duplicate time stamp {told_stamp(stamps, first)} ({count} in the file). {mend}")


def _check_gaps(stamps: NDArray[np.float64], lines: NDArray[np.int64], file: str, row: str) -> None:
    """Refuse missing samples."""
    gaps = pauses(stamps)
    if gaps.size == 0:
        return
    first = int(gaps[0])
    more = f" ({gaps.size} gaps in the file)" if gaps.size > 1 else ""
    raise InputError(
        f"{file}, between {row}s {lines[first]} and {lines[first + 1]}: {missing_behind(stamps, first)} samples are "
        f"missing, the time jumps from {told_stamp(stamps, first)} to {told_stamp(stamps, first + 1)}{more}. "
        "Split the record there into two files."
    )
