"""Is there a gap? The noise floor of each output, from the records themselves.

Three methods, of which the first possible one is used: repeated periods of one input (noise and disturbance alike), stretches in
which the input rests (sensor noise and the disturbance that passes through the rig), and the top of the spectrum, where no rig
responds (white sensor noise only: a lower bound).

The input of an element is itself measured, and its noise affects the force only while the element moves. So the noise of a force
at rest is also taken as a lower bound. This assumption is based on dampers on a test bench, whose forces no effect explains down
to that floor.

The force that would cause what a model leaves above the noise: in addition to the drive a force w moves one mass by ``H w`` with
``1 / H = k + w0^2 m - m W^2 + j W (d + sqrt(2) w0 m)``, w0 being the bandwidth of an observer and 0 in a free run. The residual
above the noise, divided by H, is the spectrum of w.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import helmert
from scipy.ndimage import uniform_filter1d

from rigsight.diagnose.noise.block_means import blocks_of
from rigsight.diagnose.policy import NOTES
from rigsight.records.record import Floats, Record
from rigsight.records.signals import differ_by_noise, repeated_period, roughness
from rigsight.rigs import Rig, evaluated

_SMOOTHED = 9
"""Lines of a spectrum that are averaged."""


@dataclass(frozen=True)
class Disturbance:
    """A disturbance force in addition to the drive."""

    std: float  # its standard deviation
    unit: str  # of the force
    below: float  # angular frequency up to which it stands above the sensor's noise [rad/s]


def disturbance(
    rig: Rig,
    values: Mapping[str, float],
    records: Sequence[Record],
    remainder: Sequence[Floats],
    noise: float,
    bandwidth: float | None,
) -> Disturbance | None:
    """Return the force that would cause the residual of a model; None except for one driven mass, and where noise hides it."""
    if not (rig.has_one_motion and rig.is_driven):
        return None
    motion, follows = rig.motion, bandwidth or 0.0
    variances, highest = [], 0.0
    for record, residual in zip(records, remainder, strict=True):
        own = {**values, **record.constants}
        inertia, damping, stiffness = (
            evaluated(part, own) for part in (motion.inertia, motion.damping, motion.stiffness)
        )
        omega, power = _power(residual, record.dt)
        covered = np.flatnonzero(power < NOTES.disturbance_above * noise**2)
        stop = int(covered[0]) if covered.size else omega.size
        omega, power = omega[:stop], power[:stop]
        real = stiffness + follows**2 * inertia - inertia * omega**2
        imaginary = omega * (damping + np.sqrt(2.0) * follows * inertia)
        force = (real**2 + imaginary**2) * (power - noise**2)
        variances.append((2.0 * float(np.sum(force)) / residual.size, residual.size))
        highest = max(highest, float(omega[-1]) if stop else 0.0)
    total = sum(size for _, size in variances)
    variance = sum(single * size for single, size in variances) / total
    return Disturbance(float(np.sqrt(variance)), rig.units["force"], highest) if variance > 0.0 else None


def _power(residual: Floats, dt: float) -> tuple[Floats, Floats]:
    """Return angular frequencies above zero and the smoothed power of each line; white noise has its variance at each."""
    window = np.hanning(residual.size)
    lines = np.abs(np.fft.rfft((residual - np.mean(residual)) * window)) ** 2 / np.sum(window**2)
    omega = 2.0 * np.pi * np.fft.rfftfreq(residual.size, dt)
    return np.asarray(omega[1:]), uniform_filter1d(lines[1:], _SMOOTHED, mode="nearest")


Stretches = tuple[tuple[Floats, float], ...]
"""Pieces of noise alone, shape (n_samples,) each, with their sample time [s]."""


@dataclass(frozen=True)
class NoiseFloor:
    """Standard deviation of the error that no model can explain in an output, and how it was found.

    ``lower_bound`` means that only part of the noise was seen: colored noise and disturbances may exceed it. ``interval`` are its
    95 % limits; the upper one of a lower bound is the error of an adequate model, infinite without one. ``stretches`` are pieces
    of noise alone with their sample time [s], where the records have any; their spectrum is that of the noise. ``disturbance`` is
    the force that would cause the error of the diagnosed model above this noise, where the records show one.
    """

    output: str
    unit: str
    std: float
    method: str
    lower_bound: bool = False
    interval: tuple[float, float] = (0.0, math.inf)
    stretches: Stretches = field(default=(), compare=False, repr=False)
    disturbance: Disturbance | None = None


_FREE_MODES = 6
_MAX_HANKEL_ROWS = 200
_SMALLEST = 1e-9
AT_REST = "stretches in which the input rests"
_WHITE_ONLY = "top of the spectrum (white noise only)"


def noise_floors(
    rig: Rig, records: Sequence[Record], drifts: bool = False, at_rest: bool = True
) -> tuple[NoiseFloor, ...]:
    """Return the noise floor of every output that the records hold."""
    # A lower bound must not decide which output counts: a filter may have taken the noise away from one of them. So lower bounds
    # have the same share of what their outputs read, the largest.
    floors, sizes = list[NoiseFloor](), list[float]()
    for signal in rig.outputs:
        holding = [record for record in records if signal.name in record]
        if holding:
            std, method, stretches, independent = _noise_floor(rig, signal.name, holding, drifts, at_rest)
            lower_bound = method == _WHITE_ONLY or (not rig.is_driven and method == AT_REST)
            spread = max(float(np.std(record[signal.name])) for record in holding)
            size = spread or max(float(np.max(np.abs(record[signal.name]))) for record in holding) or 1.0
            floors.append(
                NoiseFloor(
                    signal.name,
                    signal.unit,
                    max(std, _SMALLEST * size),
                    method,
                    lower_bound=lower_bound,
                    interval=_interval(std, independent, lower_bound),
                    stretches=stretches,
                )
            )
            sizes.append(size)
    shares = [floor.std / size for floor, size in zip(floors, sizes, strict=True) if floor.lower_bound]
    least = max(shares, default=0.0)
    return tuple(
        replace(floor, std=least * size, interval=(least * size, np.inf)) if floor.lower_bound else floor
        for floor, size in zip(floors, sizes, strict=True)
    )


def _interval(std: float, independent: Sequence[Floats], lower_bound: bool) -> tuple[float, float]:
    """Return 95 % limits of a standard deviation: those of blocks of independent pieces of the noise."""
    if lower_bound or not independent:
        return std, np.inf
    squares = blocks_of([samples[:, None] ** 2 for samples in independent])
    mean = float(squares.mean[0])
    if mean == 0.0:
        return std, np.inf
    spread = float(squares.standard_error[0]) / mean
    low, high = np.maximum(1.0 - 1.96 * spread, 0.0), 1.0 + 1.96 * spread
    return float(std * np.sqrt(low)), float(std * np.sqrt(high))


def _noise_floor(
    rig: Rig, output: str, records: Sequence[Record], drifts: bool, at_rest: bool
) -> tuple[float, str, Stretches, list[Floats]]:
    """Return standard deviation, method, pieces of noise, and as many independent pieces as they hold."""
    sources = [signal.name for signal in rig.inputs]
    repeated = _repeated(sources, output, records)
    if drifts:
        repeated = [(_without_drift(group), dt) for group, dt in repeated]
    if any(output in record.free_offsets for record in records):
        repeated = [(group - np.mean(group, axis=1, keepdims=True), dt) for group, dt in repeated]
    if repeated:
        squares = [np.var(group, axis=0, ddof=1) for group, _ in repeated]
        remainder = [(row - np.mean(group, axis=0), dt) for group, dt in repeated for row in group]
        scatter = float(np.sqrt(np.mean([float(np.mean(square)) for square in squares])))
        # n deviations from their mean are n - 1 independent ones.
        independent = [row for group, _ in repeated for row in helmert(len(group)) @ group]
        return scatter, "repeated periods of the input", tuple(remainder), independent
    top = float(np.median([_top_of_spectrum(record[output]) for record in records]))
    if not rig.is_driven:
        # A measured force is not smoothed by a mass: jumps due to friction fill the whole spectrum.
        top = min(top, float(np.median([roughness(record[output]) for record in records])))
    quiet = [q for record in records if at_rest for q in _quiet_stretches(record, sources, output)]
    if quiet:
        deviations = [float(np.std(stretch)) for stretch, _ in quiet]
        independent = [stretch for stretch, _ in quiet]
        return max(float(np.median(deviations)), top), AT_REST, tuple(quiet), independent
    return top, _WHITE_ONLY, (), []


class _Segment(NamedTuple):
    """A whole record, or one period of its input, with shapes (n_samples, n_inputs) and (n_samples,)."""

    record: Record
    driven: Floats
    output: Floats
    settled: bool

    def repeats(self, other: _Segment, size: Floats) -> bool:
        """Return True if the rig was the same and was driven alike, up to noise of inputs of this size."""
        return (
            self.driven.shape == other.driven.shape
            and bool(np.isclose(self.record.dt, other.record.dt))
            and self.record.constants == other.record.constants
            and all(map(differ_by_noise, other.driven.T, self.driven.T, size))
        )


def _repeated(sources: Sequence[str], output: str, records: Sequence[Record]) -> list[tuple[Floats, float]]:
    """Return groups of answers to the same input, shape (n_repetitions, n_samples), within records and from one to the next."""
    segments: list[_Segment] = []
    for record in records:
        driven = inputs_of(record, sources)
        if not np.any(np.ptp(driven, axis=0)):
            continue  # of a rig left alone each motion is another
        period = _common_period(driven)
        if period is None:
            segments.append(_Segment(record, driven, record[output], settled=False))
            continue
        count = record.n_samples // period
        # The first period still holds the transient.
        for i in range(1 if count > 1 else 0, count):
            part = slice(i * period, (i + 1) * period)
            segments.append(_Segment(record, driven[part], record[output][part], settled=count > 1))
    groups: list[tuple[Floats, float]] = []
    used: set[int] = set()
    for i, first in enumerate(segments):
        if i in used:
            continue
        size = np.std(first.driven, axis=0)
        size[size == 0.0] = 1.0
        alike = [j for j in range(i + 1, len(segments)) if j not in used and first.repeats(segments[j], size)]
        used.update(alike)
        if alike:
            group = [first, *(segments[j] for j in alike)]
            # Whole records may start with different motion; it has decayed by their second half.
            start = 0 if all(segment.settled for segment in group) else len(first.output) // 2
            groups.append((np.array([segment.output for segment in group])[:, start:], first.record.dt))
    return groups


def inputs_of(record: Record, sources: Sequence[str]) -> Floats:
    """Return the inputs of a record side by side, shape (n_samples, n_inputs); one it lacks rests."""
    rest = np.zeros(record.n_samples)
    return np.column_stack([record.signals.get(name, rest) for name in sources] or [rest])


def _common_period(driven: Floats) -> int | None:
    """Return after how many samples all inputs repeat themselves that do not rest; None if they do not."""
    periods = {repeated_period(column) for column in driven.T if np.ptp(column) > 0.0}
    return periods.pop() if len(periods) == 1 else None


def _without_drift(group: Floats) -> Floats:
    """Return responses to one input without the parabolas by which they differ: a constant force moves a free mass along one."""
    t = np.linspace(-1.0, 1.0, group.shape[1])
    mean = np.mean(group, axis=0)
    drift = np.polynomial.polynomial.polyfit(t, (group - mean).T, 2)
    return np.asarray(group - np.polynomial.polynomial.polyval(t, drift))


def _quiet_stretches(record: Record, sources: Sequence[str], output: str) -> list[tuple[Floats, float]]:
    """Return the settled part of the output in long stretches of constant input, about its mean, with the sample time."""
    samples = inputs_of(record, sources)
    span = np.ptp(samples, axis=0)
    if not np.any(span):
        return []  # what swings by itself is no noise, however little drives it
    # A measured input is never exactly constant: its own noise is not motion, as long as it is small.
    noise = np.array(
        [min(roughness(column), NOTES.quiet_noise * s) for column, s in zip(samples.T, span, strict=True)]
    )
    allowed = np.maximum(NOTES.quiet_input * span, NOTES.quiet_deviations * noise)
    still = np.all(np.abs(np.diff(samples, axis=0)) <= allowed, axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    found = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end - begin < NOTES.least_rest:
            continue
        moved = np.maximum(NOTES.quiet_input * span, 2.0 * NOTES.quiet_deviations * noise)
        start, stop = (begin + place for place in _held(samples[begin : end + 1], moved))
        if stop - start < NOTES.least_rest:
            continue
        settled = record[output][start + (stop - start) // 2 if start > 0 else start : stop]
        if settled.size < NOTES.least_rest // 2:
            continue
        first, second = np.array_split(settled, 2)
        trend = abs(float(np.mean(second) - np.mean(first)))
        scatter = float(np.std(np.diff(settled))) / np.sqrt(2.0)
        deviation = float(np.std(settled))
        # A drift or a decaying oscillation is not noise, one of few samples per period neither, which is as rough as noise.
        steady = trend <= max(3.0 * scatter, deviation) and np.std(first) <= 2.0 * np.std(second) + 1e-300
        if steady and not _is_free_motion(settled):
            found.append((settled - np.mean(settled), record.dt))
    return found


def _held(samples: Floats, moved: Floats) -> tuple[int, int]:
    """Return the first and the last sample of the part at one end, the longer, in which no input has moved by so much."""
    # Slow motion also has small steps: a rest from which an input starts gently ends where it has moved.

    def length(ordered: Floats) -> int:
        spanned = np.maximum.accumulate(ordered, axis=0) - np.minimum.accumulate(ordered, axis=0)
        beyond = np.flatnonzero(np.any(spanned > moved, axis=1))
        return int(beyond[0]) if beyond.size else ordered.shape[0]

    n, ahead, behind = samples.shape[0], length(samples), length(samples[::-1])
    return (0, ahead - 1) if ahead >= behind else (n - behind, n - 1)


def _is_free_motion(samples: Floats) -> bool:
    """Return True if a few exponentials (a ringing rig left alone) explain most of a stretch."""
    # Ringing sustained by a disturbance changes phase and amplitude within about a period; no exponential follows it for long.
    # R. Roy and T. Kailath, IEEE Trans. ASSP 37 (1989) 984, for poles from the shift invariance of the signal subspace.
    rows = min(samples.size // 3, _MAX_HANKEL_ROWS)
    hankel = np.lib.stride_tricks.sliding_window_view(samples - np.mean(samples), samples.size - rows + 1)
    subspace = np.linalg.eigh(hankel @ hankel.T)[1][:, -_FREE_MODES:]
    poles = np.linalg.eigvals(np.linalg.lstsq(subspace[:-1], subspace[1:], rcond=None)[0])
    poles = poles / np.maximum(np.abs(poles), 1.0)
    modes = poles[None, :] ** np.arange(samples.size)[:, None]
    centered = samples - np.mean(samples)
    explained = np.real(modes @ np.linalg.lstsq(modes, centered.astype(complex), rcond=1e-10)[0])
    return float(np.std(centered - explained)) < 0.5 * float(np.std(centered))


def _top_of_spectrum(samples: Floats) -> float:
    """Return the standard deviation of white noise with the median power of the highest lines."""
    window = np.hanning(samples.size)
    power = np.abs(np.fft.rfft((samples - np.mean(samples)) * window)) ** 2
    top = power[int(NOTES.top_of_spectrum * power.size) :]
    return float(np.sqrt(np.median(top) / np.log(2.0) / np.sum(window**2)))
