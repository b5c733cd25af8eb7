"""From which values is the fit of a candidate started? Its own guesses, the fits of simpler effects, and lines over position.

At changing speed a force that is periodic in position has no line in a spectrum over time. The response of an output to a force
``a sin(kappa s) + b cos(kappa s)`` along the measured position s follows from the linear equations: for each wave number, a
regression with coefficients common to all records. Fits start from the wave numbers that explain the largest share.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.policy import SEARCH
from rigsight.diagnose.pushes.responses import Corrections
from rigsight.effects import Effect, Place, placed_dimension
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.frequency.persistent_line import persistent_line
from rigsight.identify import FitResult
from rigsight.identify.fit.windows import leading_output
from rigsight.identify.start.declared_starts import declared_starts, moved_starts, with_own_values
from rigsight.inverse import gains_of_drives
from rigsight.records.record import Floats
from rigsight.rigs import evaluated, joint_of
from rigsight.simulate import Structure, carried_over
from rigsight.units import characteristic_value

Law = Callable[[Floats, float], Sequence[Floats]]
"""Parts of a force (or an error) along a way at a wave number, shape (n_samples,) each, one for each coefficient."""
Answer = Callable[[Floats], NDArray[np.complex128]]
"""Answer of the output to that force over the angular frequency."""


@dataclass(frozen=True)
class Run:
    """Position along a record and the residual of a model there, shape (n_samples,) each; `dt` is its sample time [s]."""

    way: Floats
    remainder: Floats
    dt: float


@dataclass(frozen=True)
class Line:
    """A wave number with the coefficients of the law's parts, and the share of the squared residual that it explains."""

    wave_number: float
    coefficients: tuple[float, ...]
    share: float


def position_lines(law: Law, runs: Sequence[Run], response: Answer, count: int = 2) -> list[Line]:
    """Return the lines that explain most, best first."""
    share = max(SEARCH.most_wave_samples // max(len(runs), 1), 64)
    runs = [_liveliest(run, share) for run in runs if _is_finite(run)]
    spans = [float(np.ptp(run.way)) for run in runs]
    span = max(spans, default=0.0)
    steps = np.concatenate([np.abs(np.diff(run.way)) for run in runs]) if runs else np.zeros(0)
    if span <= 0.0 or not np.any(steps > 0.0):
        return []
    # Two samples tell a wave at the speed that nine tenths of them do not exceed.
    shortest = 2.0 * max(float(np.quantile(steps, 0.9)), span / SEARCH.most_waves / 2.0)
    waves = np.arange(
        1.0, max(span / shortest, 1.0) + 1.0 / SEARCH.waves_per_line, 1.0 / SEARCH.waves_per_line
    )
    spectra = [_Spectrum(run, response) for run in runs]
    lines = [_line(law, spectra, float(wave)) for wave in 2.0 * np.pi * waves / span]
    shares = np.array([line.share for line in lines])
    around = np.pad(shares, 1, constant_values=-1.0)
    peaks = np.flatnonzero((shares >= around[:-2]) & (shares > around[2:]))
    return [lines[i] for i in sorted(peaks, key=lambda i: -shares[i])[:count]]


class _Spectrum:
    """Spectrum of the residual of a run, and that of a force along its position."""

    def __init__(self, run: Run, response: Answer) -> None:
        n = run.way.size
        self._window = np.hanning(n)
        omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(n, run.dt), dtype=np.float64)
        self._used = slice(SEARCH.lowest_line, None)
        self.way = run.way
        remainder = self._over_frequency(run.remainder)
        # Without weights the few lowest lines, of drift and of forces that are wrong elsewhere, would decide alone.
        size = np.asarray(
            np.sqrt(uniform_filter1d(np.abs(remainder) ** 2, SEARCH.wave_smoothing, mode="nearest"))
        )
        self._weight = 1.0 / np.maximum(size, 1e-12 * np.max(size, initial=1e-300))
        self._response = response(np.asarray(omega[self._used], dtype=np.float64)) * self._weight
        self.remainder = remainder * self._weight

    def _over_frequency(self, samples: Floats) -> NDArray[np.complex128]:
        tapered = self._window * (samples - np.mean(samples))
        return np.asarray(np.fft.rfft(tapered)[self._used] / np.sqrt(samples.size))

    def of(self, force: Floats) -> NDArray[np.complex128]:
        """Return the answer to a force."""
        return np.asarray(self._over_frequency(force) * self._response)


def _line(law: Law, spectra: Sequence[_Spectrum], wave_number: float) -> Line:
    normal, gradient, total = 0.0, 0.0, 0.0
    for spectrum in spectra:
        columns = np.array([spectrum.of(part) for part in law(spectrum.way, wave_number)])
        normal = normal + np.real(columns.conj() @ columns.T)
        gradient = gradient + np.real(columns.conj() @ spectrum.remainder)
        total += float(np.sum(np.abs(spectrum.remainder) ** 2))
    found = np.linalg.lstsq(np.atleast_2d(normal), np.atleast_1d(gradient), rcond=None)[0]
    share = float(found @ np.atleast_1d(gradient)) / total if total > 0.0 else 0.0
    return Line(wave_number, tuple(map(float, found)), share)


def _is_finite(run: Run) -> bool:
    """Return False for the residual of a model that diverges, also where only its square exceeds all numbers."""
    with np.errstate(over="ignore"):
        return bool(np.isfinite(run.way).all() and np.isfinite(np.sum(run.remainder**2)))


def _liveliest(run: Run, n_samples: int) -> Run:
    if run.way.size <= n_samples:
        return run
    energy = np.cumsum(np.r_[0.0, (run.remainder - np.mean(run.remainder)) ** 2])
    start = int(np.argmax(energy[n_samples:] - energy[:-n_samples]))
    stop = start + n_samples
    return Run(run.way[start:stop], run.remainder[start:stop], run.dt)


_DAMPING_RATIO = 0.5
"""Of the oscillator that stands for a rig of several motions: it only has to fall as a mass does above its resonance."""


def wave_starts(context: FitContext, effect: Effect, base: FitResult) -> Iterator[dict[str, float]]:
    """Yield an effect's own values at the position-periodic lines in the residual of a fit without it."""
    if len(base.residuals) != len(context.estimation):
        return
    names, law = _law_of(effect)
    runs, sign = _runs(context, effect, base)
    for line in position_lines(law, runs, _response_at(context, effect, base)):
        own = {name: sign * value for name, value in zip(names, line.coefficients, strict=True)}
        yield {**own, str(effect.wave_number): line.wave_number}


def _law_of(effect: Effect) -> tuple[list[str], Law]:
    """Return the coefficients of an effect, and its parts along a way at a wave number."""
    law = effect.torque if effect.measured is None else effect.measured
    signal = canonical.position if effect.measured is None else canonical.reading
    wave = sp.Symbol(str(effect.wave_number), real=True)
    names = [p.name for p in effect.parameters if p.fitted and p.name != effect.wave_number]
    slopes = [derivative(law, sp.Symbol(name, real=True)) for name in names]
    parts = sp.lambdify((signal, wave), slopes, "numpy")

    def along(way: Floats, wave_number: float) -> Sequence[Floats]:
        return [np.broadcast_to(part, way.shape) for part in parts(way, wave_number)]

    return names, along


def _runs(context: FitContext, effect: Effect, base: FitResult) -> tuple[list[Run], float]:
    """Return the position that an effect reads along each record with the residual there, and the sign of its contribution."""
    rig = context.rig
    outputs = [signal.name for signal in rig.outputs]
    if effect.place is Place.SENSOR or rig.has_one_motion:
        shown = rig.acts_at(effect) if effect.place is Place.SENSOR else outputs[0]
        moved = shown if rig.is_driven else rig.inputs[0].name
        column = outputs.index(shown)
        runs = [
            Run(record[moved], residual[:, column], record.dt)
            for record, residual in zip(context.estimation, base.residuals, strict=True)
            if shown in record
        ]
        return runs, 1.0 if effect.place is Place.SENSOR or not rig.is_driven else -1.0
    corrections, runs = Corrections(rig), []
    for record, residual in zip(context.estimation, base.residuals, strict=True):
        measured = set(record.signals) & set(outputs)
        readings = np.column_stack(
            [record[name] if name in measured else np.zeros(record.n_samples) for name in outputs]
        )
        own = joint_of(rig, effect).name
        way, remainder = (
            corrections.of_joint(own, part, measured) for part in (readings, np.nan_to_num(residual))
        )
        if way is not None and remainder is not None:
            runs.append(Run(way, remainder, record.dt))
    return runs, -1.0


def _response_at(context: FitContext, effect: Effect, base: FitResult) -> Answer:
    """Return the response of the residual to a force at the effect's joint; 1 for a sensor error or a measured force."""
    rig = context.rig
    if effect.place is Place.SENSOR or not rig.is_driven:
        return lambda omega: np.ones(omega.size, dtype=np.complex128)
    joint = joint_of(rig, effect)
    inertia = joint.inertia if joint.inertia is not None else rig.mechanism.inertia_along(joint.motion)
    at_zero = {coordinate.name: 0.0 for coordinate in rig.mechanism.coordinates}
    mass = evaluated(inertia, {**at_zero, **base.values}) if inertia is not None else 1.0
    if rig.has_one_motion:
        stiffness, damping = (evaluated(e, base.values) for e in (joint.stiffness, joint.damping))
    else:
        natural = 1.0 / characteristic_value(placed_dimension(effect, "time"), context.scales)
        stiffness, damping = mass * natural**2, 2.0 * _DAMPING_RATIO * mass * natural

    def response(omega: Floats) -> NDArray[np.complex128]:
        return np.asarray(1.0 / (stiffness - mass * omega**2 + 1j * damping * omega), dtype=np.complex128)

    return response


def start_values(
    context: FitContext,
    structure: Structure,
    effect: Effect,
    base: FitResult,
    parents: Mapping[str, FitResult],
) -> Iterator[dict[str, float]]:
    """Yield start values of all parameters for a fit with `effect`."""
    starts = list(declared_starts(structure, effect, context.scales, base, parents))
    if effect.wave_number is not None:
        waves = [with_own_values(structure, effect, base, own) for own in wave_starts(context, effect, base)]
        yield from waves or starts
        return
    yield from starts
    yield from _with_larger_gain(context, structure, effect, starts[0])
    line = _persistent_line(context, base) if effect.pulsation is not None else None
    if line is not None:
        yield {**starts[0], structure.parameter_name(effect, str(effect.pulsation)): line}


def _with_larger_gain(
    context: FitContext, structure: Structure, effect: Effect, start: Mapping[str, float]
) -> Iterator[dict[str, float]]:
    """Yield a start of a limit of a drive at a larger gain, with the same limit of its force."""
    limits = [p.name for p in effect.parameters if p.is_limit]
    if effect.place is not Place.ACTUATOR or not limits:
        return
    free = context.free_parameters(structure)
    for gain, drive in gains_of_drives(context.rig).items():
        if drive.name == context.rig.acts_at(effect) and gain in free:
            of_force = 1.0 if sp.Symbol(gain, real=True) in drive.signal.free_symbols else SEARCH.larger_gain
            names = [structure.parameter_name(effect, limit) for limit in limits]
            limited = {name: start[name] / of_force for name in names}
            yield {**start, **limited, gain: SEARCH.larger_gain * start[gain]}


def _persistent_line(context: FitContext, base: FitResult) -> float | None:
    if len(base.residuals) != len(context.estimation):
        return None
    output = leading_output(context.rig, context.estimation)
    column = [signal.name for signal in context.rig.outputs].index(output)
    seen = [
        (residual[:, column], record.dt)
        for residual, record in zip(base.residuals, context.estimation, strict=True)
        if output in record
    ]
    return persistent_line([residual for residual, _ in seen], [dt for _, dt in seen])


def restart_values(structure: Structure, effect: Effect, fit: FitResult) -> Iterator[dict[str, float]]:
    """Yield further start values for a fit with `effect` that may have stopped in a local minimum."""
    for moved in moved_starts(structure, effect, fit.values):
        yield {**carried_over(fit.values, fit.structure, structure), **moved}
