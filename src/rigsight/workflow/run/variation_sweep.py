"""The sweep with which a model is simulated for its frequency response: logarithmic, about its natural frequencies."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass

import numpy as np
import sympy as sp

from rigsight.errors import InputError, SimulationError
from rigsight.excitation import log_sweep
from rigsight.identify.hysteresis import SpectralRatio
from rigsight.records import Record
from rigsight.rigs import evaluated
from rigsight.simulate import Model, parameter_vector, rest_state, without_vanished_effects
from rigsight.simulate.equations.straight_line import straight_line
from rigsight.simulate.equations.structure import TIME, input_symbols
from rigsight.simulate.input_hold import hold_input, together

MARGIN = (0.5, 1.6)
"""Factors by which the sweep reaches beyond the band."""
_BAND = (1.0 / 12.0, 6.0)
"""Ends of the band over the natural frequency: the lowest and the highest of several, at the amplitude of the sweep."""
_GROWTH = math.log(640.0 / 1e-3) / 150.0 / 12.0
"""Rate of the thesis's sweep (section 4.2) per radian of the identified natural frequency, e-folds per radian."""
_SAMPLES_PER_PERIOD = 10.0
_N_FREQUENCIES = 400
"""A parabola through three of them finds a well damped peak to 1e-4 of its frequency."""
_OSCILLATES = 0.1
"""Least share of the imaginary part of a pole that makes a natural frequency: a damping ratio below 0.995."""
_NUDGE = 1e-6
"""Step of the differences by which a model is linearized; most kinks are far from rest."""


@dataclass(frozen=True)
class Pair:
    """Names of an input and of an output."""

    source: str
    response: str


def variation_sweep(
    model: Model, pair: Pair, amplitude: float, band: tuple[float, float] | None, slowness: float = 1.0
) -> tuple[Record, SpectralRatio]:
    """Return the sweep, with the other inputs at rest, and the estimator of the response."""
    rig = model.structure.rig
    slowest = None
    if band is None:
        naturals = _natural_frequencies(model, amplitude)
        slowest = naturals[0]
        band = (_BAND[0] * slowest, _BAND[1] * naturals[-1])
    if not 0.0 < band[0] < band[1] < math.inf:
        raise InputError(
            f"The band needs 0 < lowest < highest, got {band[0]:g} and {band[1]:g} rad/s (--lowest, --highest)."
        )
    if slowest is None:
        slowest = math.sqrt(band[0] * band[1]) / math.sqrt(_BAND[0] * _BAND[1])
    start, stop = MARGIN[0] * band[0], MARGIN[1] * band[1]
    dt = 2.0 * math.pi / (_SAMPLES_PER_PERIOD * stop)
    duration = math.log(stop / start) / (_GROWTH * slowest) * slowness
    t = dt * np.arange(round(duration / dt) + 1, dtype=np.float64)
    record = Record(
        name=f"sweep of {amplitude:g} {rig.signal_units[pair.source]}",
        dt=dt,
        signals={
            signal.name: log_sweep(t, amplitude, start, stop)
            if signal.name == pair.source
            else np.zeros_like(t)
            for signal in rig.inputs
        },
        units=rig.signal_units,
        kind="sweep",
        amplitude=amplitude,
        # A prescribed motion is smooth between its samples, whatever the hold of other inputs.
        hold="band_limited" if pair.source in rig.mechanism.prescribing else model.hold,
    )
    omega = np.geomspace(*band, _N_FREQUENCIES)
    return record, SpectralRatio(pair.source, pair.response, omega, SpectralRatio.width / slowness)


def _natural_frequencies(model: Model, amplitude: float) -> list[float]:
    """Return the natural frequencies of a model [rad/s], increasing."""
    if model.structure.rig.has_one_motion:
        return [_natural_frequency(model, amplitude)]
    poles = _poles(model)
    if poles is None:
        raise InputError(
            "The equations of the model have no finite slope about its equilibrium, and so no natural frequency: give the band "
            "with --lowest and --highest [rad/s]."
        )
    sizes = np.abs(poles)
    found = sizes[np.abs(poles.imag) > _OSCILLATES * sizes]
    if found.size == 0:
        raise InputError(
            "The model has no natural frequency about its equilibrium: give the band with --lowest and --highest [rad/s]."
        )
    return [float(size) for size in np.unique(found)]


def _poles(model: Model) -> np.ndarray[tuple[int], np.dtype[np.complex128]] | None:
    """Return the eigenvalues of a model about its equilibrium without input; None if a slope is infinite there."""
    structure, values = without_vanished_effects(model.structure, model.values)
    p = parameter_vector(structure, values)
    n_inputs = len(structure.rig.inputs)
    rest = rest_state(structure, p, together([hold_input(np.zeros(2), 1.0, "foh")] * n_inputs))
    known = dict(zip(structure.parameter_symbols, p, strict=True))
    known |= {symbol: 0.0 for i in range(n_inputs) for symbol in input_symbols(i)} | {TIME: 0.0}
    functions = {"positive_part": lambda value: max(value, 0.0)}
    own_rates, modules = [e.rate for e in structure.equations], [functions, "numpy"]
    if structure.steps:
        line = straight_line(own_rates, structure.steps)
        in_parts = line.function([*structure.states, *known], modules)

        def rates(x: np.ndarray[tuple[int], np.dtype[np.float64]]) -> list[float]:
            return in_parts(*x, *known.values())  # type: ignore[no-any-return]
    else:
        rates = sp.lambdify([structure.states], [rate.xreplace(known) for rate in own_rates], modules)
    jacobian = np.empty((rest.size, rest.size))
    for i in range(rest.size):
        step = np.zeros(rest.size)
        step[i] = _NUDGE
        jacobian[:, i] = (np.array(rates(rest + step)) - np.array(rates(rest - step))) / (2.0 * _NUDGE)
    if not np.all(np.isfinite(jacobian)):
        return None
    return np.asarray(np.linalg.eigvals(jacobian), dtype=np.complex128)


def _natural_frequency(model: Model, amplitude: float) -> float:
    """Return the natural frequency [rad/s] with the stiffness that holds a constant input of this amplitude."""
    # A hysteretic spring is much stiffer for small motion than at the resonance of a sweep.
    motion = model.structure.rig.motion
    drive, stiffness, inertia, rest = (
        evaluated(part, model.values)
        for part in (motion.drive_gain, motion.stiffness, motion.inertia, motion.rest)
    )
    if stiffness <= 0.0:
        raise InputError(
            "The model has no spring and so no natural frequency: give the band with --lowest and --highest [rad/s]."
        )
    held = hold_input(np.full(3, amplitude), 1.0, "zoh")
    structure, values = without_vanished_effects(model.structure, model.values)
    with contextlib.suppress(SimulationError):
        moved = float(rest_state(structure, parameter_vector(structure, values), held)[0]) - rest
        # Dry friction or a dead zone may hold the rig where it is.
        secant = drive * amplitude / moved if moved != 0.0 else math.inf
        if 0.0 < secant < math.inf:
            stiffness = secant
    return math.sqrt(stiffness / inertia)
