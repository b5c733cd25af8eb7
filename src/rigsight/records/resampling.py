"""How do signals with clocks of their own, or with stamps that wander, come onto one even clock, and what does it cost?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.errors import InputError
from rigsight.records.conditioning import FEWEST_SAMPLES, TimeBase
from rigsight.records.formats.channel import MOST_SAMPLES
from rigsight.records.record import Floats, Hold
from rigsight.records.stamps import written_stamp

# Of the sample time: closer than this, a stamp lies on the grid.
_ON_GRID = 1e-6
# What a step may be coarser than the samples without a filter: sample times are not known better.
_COARSER = 1.01
# Of the mean step: closer stamps are averaged, or the spline through them would amplify the noise of the slope between them.
_CLOSE = 0.3
# Of the new Nyquist frequency: where the filter before decimation begins to close; it is closed at that frequency.
_PASSBAND = 0.8
# New samples to each side that this takes of a Kaiser window, and its shape: 60 dB each of forward and backward, and a gain of 1
# before, unlike the filters with ripple of `scipy.signal.decimate`.
_FILTER_LENGTH, _FILTER_SHAPE = 20, 6.0


@dataclass(frozen=True, eq=False)
class Resampled:
    """Signals on one even clock."""

    # First stamp and sample time [s].
    t0: float
    dt: float
    samples: Mapping[str, Floats]  # signal name -> samples, shape (n_samples,) each
    notes: tuple[str, ...] = ()  # what was interpolated, how, and at which cost
    is_filtered: bool = False  # whether an input was filtered, so that it is held no more between the samples
    # Time [s] by which signals may be late against each other, as far as the clocks can tell.
    clock_uncertainty: float = 0.0


def joined(
    file: str,
    samples: Mapping[str, Floats],
    bases: Mapping[str, TimeBase],
    clocks: Mapping[str, str],
    step: float | None,
    holds: Mapping[str, Hold],
) -> Resampled:
    """Return the signals on the even clock that all of them cover."""
    # A held input (``"zoh"``) becomes its mean over each sample, which keeps its impulse; outputs and other inputs are
    # interpolated by cubic splines, inputs of ``"foh"`` linearly where that predicts left out samples better. For a clock coarser
    # than that of a signal, the signal is low-pass filtered first, without delay.
    distinct = list({id(base): base for base in bases.values()}.values())
    dt = min(base.dt for base in distinct) if step is None else step
    # Its stamps are those of a held input, which steps there, or else of a clock of that rate.
    held = [base for signal, base in bases.items() if holds.get(signal) == "zoh"]
    same = [base for base in bases.values() if abs(base.dt / dt - 1.0) < _ON_GRID]
    reference = [*held, *same, max(bases.values(), key=lambda base: base.t0)][0]
    start, n_samples = _common(file, bases, dt, reference, step)
    grid = start + dt * np.arange(n_samples, dtype=np.float64)
    is_filtered = any(dt > _COARSER * base.dt for base in distinct)
    driven_finer = any(dt > _COARSER * base.dt for name, base in bases.items() if name in holds)
    on_clock: dict[str, Floats] = {}
    how, costs = [], []
    for signal, base in bases.items():
        position = (start - base.t0) / base.dt
        same_rate = abs(dt / base.dt - 1.0) < _ON_GRID / n_samples
        if base.stamps is None and same_rate and abs(position - round(position)) < _ON_GRID:
            on_clock[signal] = samples[signal][round(position) : round(position) + n_samples]
            continue
        hold = holds.get(signal)
        if dt > _COARSER * base.dt:
            on_clock[signal] = _decimated(samples[signal], base, grid, dt, hold)
            how.append(f"{signal} low-pass filtered, from {base.dt:.6g} s")
            continue
        hold = "band_limited" if driven_finer and hold is not None else hold
        on_clock[signal], manner, cost = _interpolated(samples[signal], base, grid, dt, hold)
        how.append(f"{signal} {manner}" + ("" if same_rate else f", from {base.dt:.6g} s"))
        costs.append(f"{signal} {100.0 * cost:.2g} %")
    notes = [note for base in distinct for note in base.notes]
    jitter = max(distinct, key=lambda base: base.jitter)
    apart = len(distinct) > 1 and _differ(distinct)
    if how or apart:
        notes.append(_note(file, bases, clocks if apart else {}, dt, how, costs, jitter, step, is_filtered))
    # Separate clocks agree no better than to a sample: a stamp tells when a device wrote it.
    uncertainty = max(max(float(apart), base.jitter) * base.dt for base in distinct)
    return Resampled(start, dt, on_clock, tuple(notes), driven_finer, uncertainty)


def _common(
    file: str, bases: Mapping[str, TimeBase], dt: float, reference: TimeBase, step: float | None
) -> tuple[float, int]:
    """Return the first stamp and the number of samples of the clock that all signals cover."""
    earliest = max(base.t0 for base in bases.values())
    stop = min(base.end for base in bases.values())
    start = reference.t0 + dt * max(0.0, np.ceil((earliest - reference.t0) / dt - _ON_GRID))
    asked = (stop - start) / dt
    if not asked <= MOST_SAMPLES:
        how = f"resample = {step:g}" if step is not None else f"the finest sample time, {dt:g} s,"
        raise InputError(f"{file}: {how} makes {asked:.3g} samples, more than the limit of {MOST_SAMPLES}.")
    n_samples = int(np.floor(asked + _ON_GRID)) + 1
    if n_samples < FEWEST_SAMPLES:
        spans = "; ".join(
            f"{signal} from {written_stamp(base.t0, dt, 6)} s to {written_stamp(base.end, dt, 6)} s"
            for signal, base in bases.items()
        )
        raise InputError(
            f"{file}: the signals have {max(n_samples, 0)} samples of {dt:g} s in common ({spans}); at least {FEWEST_SAMPLES} "
            "are needed for a record. Do their clocks count from the same moment? If not, correct the time of one in the file."
        )
    return start, n_samples


def _interpolated(
    samples: Floats, base: TimeBase, grid: Floats, dt: float, hold: Hold | None
) -> tuple[Floats, str, float]:
    """Return samples of shape (n_samples,) on the new clock, the manner in which they were found, and the cost over the RMS."""
    # Of a held input the cost is what differs from it between the samples; of others the error with which every second sample is
    # found from its neighbors: the noise included, and at twice the distance that is interpolated here.
    stamps, rms = base.times(), float(np.std(samples)) or 1.0
    if hold == "zoh":
        means, spread = _means_of_held(samples, stamps, grid, dt)
        return means, "held", spread / rms
    kept, left = slice(None, None, 2), slice(1, -1, 2)
    missed = _spline(stamps[kept], samples[kept], stamps[left], 2.0 * base.dt) - samples[left]
    by_spline = float(np.sqrt(np.mean(missed**2))) / rms
    if hold == "foh":
        missed = np.interp(stamps[left], stamps[kept], samples[kept]) - samples[left]
        linearly = float(np.sqrt(np.mean(missed**2))) / rms
        # A smooth input loses height on straight lines, one with corners overshoots on splines: its own samples tell which it is.
        if linearly <= by_spline:
            return np.interp(grid, stamps, samples), "linearly", linearly
    return _spline(stamps, samples, grid, base.dt), "by cubic splines", by_spline


def _means_of_held(samples: Floats, stamps: Floats, grid: Floats, dt: float) -> tuple[Floats, float]:
    """Return a signal held over each sample of the grid, and the RMS of what it differs from the one held at the stamps."""
    # It is the mean over the sample, which alone would be late or early by the moment of what lies within; that moment is made up
    # for by the samples beside it.
    edges = np.append(grid, grid[-1] + dt)
    first = np.clip(np.searchsorted(stamps, grid + _ON_GRID * dt, "right") - 1, 0, None)
    last = np.clip(np.searchsorted(stamps, edges[1:] - _ON_GRID * dt, "left") - 1, 0, None)
    changes = np.concatenate([[0], np.cumsum(np.diff(samples) != 0.0)])
    is_held = changes[first] == changes[last]
    if is_held.all():
        return samples[first], 0.0
    center = float(np.mean(samples))
    levels = samples - center
    steps = np.diff(np.append(stamps, max(stamps[-1], edges[-1]) + dt))
    at = np.clip(np.searchsorted(stamps, edges, "right") - 1, 0, None)
    within = edges - stamps[at]

    def integral(values: Floats) -> tuple[Floats, Floats]:
        once = np.concatenate([[0.0], np.cumsum(values * steps)])
        return once[at] + values[at] * within, once

    area, once = integral(levels)
    twice = np.concatenate([[0.0], np.cumsum((once[:-1] + 0.5 * levels * steps) * steps)])
    area_of_area = twice[at] + (once[at] + 0.5 * levels[at] * within) * within
    mean = np.where(is_held, levels[first], np.diff(area) / dt)
    moment = 0.5 * dt * (area[1:] + area[:-1]) - np.diff(area_of_area)
    moment[is_held] = 0.0
    beside = np.pad(moment, 1)
    mean_square = np.diff(integral(levels**2)[0]) / dt
    spread = float(np.sqrt(np.mean(np.where(is_held, 0.0, np.maximum(mean_square - mean**2, 0.0)))))
    # Exact where nothing changes near.
    mean = np.where(is_held, samples[first], center + mean)
    return mean + (beside[:-2] - beside[2:]) / (2.0 * dt**2), spread


def _spline(stamps: Floats, samples: Floats, grid: Floats, step: float) -> Floats:
    """Return smooth samples on another clock, shape of `grid`; samples much closer than `step` are averaged first."""
    # Slow to load, and every process that reads a file apart would wait for it.
    from scipy.interpolate import CubicSpline

    # Counted from the first, so that stamps since 1970 lose no digits.
    origin = stamps[0]
    place, values = stamps - origin, samples
    if place.size > 2 and float(np.min(np.diff(place))) < _CLOSE * step:
        starts = [0]
        for i in range(1, place.size):
            if place[i] - place[starts[-1]] >= _CLOSE * step:
                starts.append(i)
        count = np.diff([*starts, place.size])
        place, values = (np.add.reduceat(array, starts) / count for array in (place, values))
    at = np.clip(grid - origin, place[0], place[-1])
    return np.asarray(CubicSpline(place, values)(at), dtype=np.float64)


def _decimated(samples: Floats, base: TimeBase, grid: Floats, dt: float, hold: Hold | None) -> Floats:
    """Return samples of shape (n_samples,) on a coarser clock, low-pass filtered forward and backward."""
    from scipy.signal import filtfilt, firwin

    count = int((base.end - base.t0) / base.dt + _ON_GRID) + 1
    own = base.t0 + base.dt * np.arange(count, dtype=np.float64)
    even = samples if base.stamps is None else _interpolated(samples, base, own, base.dt, hold)[0]
    n_taps = 2 * int(np.ceil(_FILTER_LENGTH * dt / base.dt)) + 1
    cutoff = 0.5 * (1.0 + _PASSBAND) * base.dt / dt
    taps = np.asarray(firwin(n_taps, cutoff, window=("kaiser", _FILTER_SHAPE)))
    # A held sample stands for the time behind it: in the middle, half a sample later.
    late = 0.5 * base.dt if hold == "zoh" else 0.0
    smooth = filtfilt(taps, [1.0], np.asarray(even, dtype=np.float64), padlen=min(even.size - 1, n_taps))
    return _spline(own + late, np.asarray(smooth, dtype=np.float64), grid, base.dt)


def _differ(distinct: Sequence[TimeBase]) -> bool:
    """Return True if clocks are more than copies of one."""
    return any(not np.array_equal(base.times(), distinct[0].times()) for base in distinct[1:])


def _note(
    file: str,
    bases: Mapping[str, TimeBase],
    clocks: Mapping[str, str],
    dt: float,
    how: Sequence[str],
    costs: Sequence[str],
    jitter: TimeBase,
    step: float | None,
    is_filtered: bool,
) -> str:
    why = []
    if clocks:
        listed = ", ".join(
            f"{signal} by '{clocks[signal]}' every {base.dt:.6g} s from {written_stamp(base.t0, base.dt, 6)} s"
            for signal, base in bases.items()
        )
        why.append(f"the signals have clocks of their own ({listed})")
    if jitter.jitter > 0.0:
        steps = f"{jitter.n_far} of {jitter.n_samples - 1} steps by more than half of that"
        share = float(f"{100.0 * jitter.jitter:.2g}")
        why.append(f"time stamps jitter by up to {share:g} % of the sample time ({steps})")
    if step is not None:
        why.append(f"resample = {step:g} is asked for")
    cost = f" Error at most about {', '.join(costs)} of the RMS, noise included." if costs else ""
    lost = f" What is faster than {0.5 * _PASSBAND / dt:.4g} Hz is lost." if is_filtered else ""
    done = f"Resampled to {dt:.6g} s: {'; '.join(how)}" if how else "Joined by whole samples"
    return f"{file}: {'; '.join(why)}. {done}.{lost}{cost}"
