"""Start values of the wave number of position-periodic effects, from lines in the residual spectra."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.diagnose.fitting.fit_context import FitContext
from rigsight.diagnose.pushes.measured_motion import Corrections
from rigsight.diagnose.search.position_line import Answer, Floats, Law, Run, position_lines
from rigsight.effects import Effect, Place, placed_dimension
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.identify import FitResult
from rigsight.rigs import evaluated, joint_of
from rigsight.units import characteristic_value

_DAMPING_RATIO = 0.5
"""Of the oscillator that stands for a rig of several motions: it only has to fall as a mass does above its resonance."""


def wave_starts(context: FitContext, effect: Effect, base: FitResult) -> Iterator[dict[str, float]]:
    """Yield an effect's own values at the position-periodic lines in the residual of a fit without it."""
    if len(base.residuals) != len(context.estimation):
        return
    names, law = _law(effect)
    runs, sign = _runs(context, effect, base)
    for line in position_lines(law, runs, _response(context, effect, base)):
        own = {name: sign * value for name, value in zip(names, line.coefficients, strict=True)}
        yield {**own, str(effect.wave_number): line.wave_number}


def _law(effect: Effect) -> tuple[list[str], Law]:
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


def _response(context: FitContext, effect: Effect, base: FitResult) -> Answer:
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

    def response(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        return np.asarray(1.0 / (stiffness - mass * omega**2 + 1j * damping * omega), dtype=np.complex128)

    return response
