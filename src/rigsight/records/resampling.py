"""Resampling of signals with different rates to one time axis, if the campaign requests it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.conditioning import FEWEST_SAMPLES, TimeBase
from rigsight.records.formats.channel import MOST_SAMPLES
from rigsight.records.record import Hold
from rigsight.records.stamps import written_stamp

# Of the sample time: closer than this, a stamp lies on the grid.
_ON_GRID = 1e-6
# What a step may be coarser than the samples: sample times are not known better.
_COARSER = 1.01


@dataclass(frozen=True, eq=False)
class Resampled:
    """Signals on one even axis.

    Attributes
    ----------
    t0, dt
        First stamp and sample time [s].
    samples
        Signal name -> samples, shape (n_samples,) each.
    notes
        What was interpolated, and how.
    """

    t0: float
    dt: float
    samples: Mapping[str, NDArray[np.float64]]
    notes: tuple[str, ...]


def refuse_different_axes(file: str, bases: Mapping[str, TimeBase], labels: Mapping[str, str]) -> NoReturn:
    """Refuse signals that do not share one time axis.

    Raises
    ------
    InputError
        Always: with the sample times and lengths that were found, and the key that resamples.
    """
    listed = ", ".join(
        f"{signal} ('{labels[signal]}') every {base.dt:.6g} s from {written_stamp(base.t0, base.dt, 6)} s"
        for signal, base in bases.items()
    )
    finest = min(base.dt for base in bases.values())
    raise InputError(
        f"{file}: the signals do not share one time axis: {listed}. Records are resampled only on request: give the record "
        f"resample = {finest:.6g} (sample time in seconds), or map signals of one rate."
    )


def resampled(
    file: str,
    samples: Mapping[str, NDArray[np.float64]],
    bases: Mapping[str, TimeBase],
    step: float,
    holds: Mapping[str, Hold],
) -> Resampled:
    """Return the signals on the even axis that all of them cover.

    Inputs are interpolated according to their hold, outputs, which are smooth, by cubic splines. An axis coarser than the samples
    is rejected, because content above its Nyquist frequency would alias.

    Parameters
    ----------
    file
        Name for messages.
    samples
        Signal name -> samples, shape (n_samples,).
    bases
        Signal name -> its own even grid [s].
    step
        Sample time asked for [s].
    holds
        Hold of every input.

    Raises
    ------
    InputError
        If the step is coarser than a signal's samples, or the signals overlap too little.
    """
    for signal, base in bases.items():
        if step > _COARSER * base.dt:
            raise InputError(
                f"{file}: resample = {step:g} is coarser than the samples of {signal}, {base.dt:.6g} s apart; faster signal "
                f"content would alias. Give at most {min(b.dt for b in bases.values()):.6g}, or decimate it before."
            )
    start = max(base.t0 for base in bases.values())
    stop = min(base.t0 + base.dt * (samples[signal].size - 1) for signal, base in bases.items())
    asked = (stop - start) / step
    if not asked <= MOST_SAMPLES:
        raise InputError(
            f"{file}: resample = {step:g} makes {asked:.3g} samples, more than the limit of {MOST_SAMPLES}."
        )
    n_samples = int(np.floor(asked + _ON_GRID)) + 1
    if n_samples < FEWEST_SAMPLES:
        span = " to ".join(f"{written_stamp(stamp, step, 6)} s" for stamp in (start, stop))
        raise InputError(
            f"{file}: the signals have {max(n_samples, 0)} samples of {step:g} s in common (from {span}); "
            f"at least {FEWEST_SAMPLES} are needed for a record. Do their clocks start together?"
        )
    on_axis, how = {}, []
    for signal, base in bases.items():
        even = base.resample(samples[signal], holds.get(signal))
        position = (start - base.t0) / base.dt
        if abs(step / base.dt - 1.0) < _ON_GRID / n_samples and abs(position - round(position)) < _ON_GRID:
            on_axis[signal] = even[round(position) : round(position) + n_samples]
            continue
        on_axis[signal], manner = _interpolated(even, base, start, step, n_samples, holds.get(signal))
        how.append(f"{signal} from {base.dt:.6g} s ({manner})")
    note = f"{file}: resampled to {step:g} s as requested in the campaign: {', '.join(how)}."
    return Resampled(start, step, on_axis, (note,) if how else ())


def _interpolated(
    even: NDArray[np.float64], base: TimeBase, start: float, step: float, n_samples: int, hold: Hold | None
) -> tuple[NDArray[np.float64], str]:
    """Return samples of shape (n_samples,) on the new axis, and in which manner they were interpolated."""
    # In samples of the old axis, so that a long record loses no digits.
    position = (start - base.t0) / base.dt + (step / base.dt) * np.arange(n_samples, dtype=np.float64)
    position = np.clip(position, 0.0, even.size - 1.0)
    if hold == "zoh":
        return even[np.floor(position + _ON_GRID).astype(np.int64)], "held"
    index = np.arange(even.size, dtype=np.float64)
    if hold == "foh":
        return np.interp(position, index, even), "linearly"
    # Slow to load, and every process that reads a file apart would wait for it.
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(index, even)(position), dtype=np.float64), "cubic spline"


def in_seconds(base: TimeBase, scale: float, offset: float) -> TimeBase:
    """Return an even grid in seconds: stamp in seconds = scale * stamp + offset."""
    stamps = None if base.stamps is None else scale * base.stamps + offset
    return replace(base, t0=scale * base.t0 + offset, dt=scale * base.dt, stamps=stamps)
