"""Why does a model leave more on a record than usual? One changed number at a time: of the rig, of an effect, of a sensor.

Each number is fitted to the record alone, beside its initial state. More than that is not told: what acts at the same place with
the same phase, such as dry friction beside damping, changes the same number.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.compare.on_one_record import FreeRun
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records import Record
from rigsight.simulate import Structure
from rigsight.simulate.model import Model

_ACCURACY, _TOLERANCE, _EVALUATIONS = 1e-3, 1e-3, 12
"""Of fits that only rank: their errors stay below a hundredth of the gap."""
_FARTHER = (0.8, 1.25)
"""Factors on a number from which it is fitted once more where no number explains the larger part of the gap."""
_EXPLAINED = 0.5


@dataclass(frozen=True)
class Suspect:
    """A number whose change explains a part of a gap."""

    what: str  # such as ``"k_c"`` or ``"gain of psi"``
    where: str  # joint, drive or sensor; empty for a number of several
    share: float  # of the squared gap, in units of the noise floors
    unit: str
    before: float  # its value in the model
    after: float  # the value that explains most


def suspects(
    model: Model, windows: Sequence[Record], run: FreeRun, noise: Mapping[str, float]
) -> list[Suspect]:
    """Return the numbers whose change explains a part of the gap, the one that explains most first."""
    found = [*_of_sensors(model, windows, run, noise), *_of_equations(model, windows, noise)]
    return sorted((one for one in found if one.share > 0.0), key=lambda one: -one.share)


def place_of(structure: Structure, name: str) -> str:
    """Return the joint, drive, sensor or state in whose equation alone a parameter stands; empty if there is none."""
    mechanism = structure.rig.mechanism
    for effect in structure.effects:
        if name in {structure.parameter_name(effect, p.name) for p in effect.parameters}:
            return structure.rig.where(effect)
    places = {
        **{
            j.name: (j.stiffness, j.damping, j.rest, j.force, *([] if j.inertia is None else [j.inertia]))
            for j in mechanism.joints
        },
        **{d.name: (d.signal, d.force) for d in mechanism.drives},
        **{s.name: (s.reads,) for s in mechanism.sensors},
        **{str(s.symbol): (s.rate,) for s in mechanism.states},
    }
    holding = [
        place
        for place, expressions in places.items()
        if any(name in {symbol.name for symbol in e.free_symbols} for e in expressions)
    ]
    if not holding and len(mechanism.joints) == 1:
        return mechanism.joints[0].name
    return holding[0] if len(holding) == 1 else ""


def _of_equations(model: Model, windows: Sequence[Record], noise: Mapping[str, float]) -> Iterator[Suspect]:
    structure = model.structure
    scales = characteristic_scales(structure.rig, windows, model.values)
    problem = GreyBoxFit(structure, windows, scales, noise, _ACCURACY)

    def fitted(free: Sequence[str], factor: float = 1.0) -> tuple[float, dict[str, float]]:
        start = {**model.values, **{name: factor * model.values[name] for name in free}}
        result = problem.fit(start, free, None, _EVALUATIONS, _TOLERANCE, finish=False)
        return result.cost if np.isfinite(result.cost) else np.inf, result.values

    before, _ = fitted([])
    if not 0.0 < before < np.inf:
        return
    names = [parameter.name for parameter in structure.parameters]
    found = {name: fitted([name]) for name in names}
    if min(cost for cost, _ in found.values()) > _EXPLAINED * before:
        # Where motion jumps to another branch, a fit does not find the way there by itself.
        for name in names:
            tried = [found[name], *(fitted([name], factor) for factor in _FARTHER)]
            found[name] = min(tried, key=lambda outcome: outcome[0])
    for parameter in structure.parameters:
        cost, values = found[parameter.name]
        if cost < np.inf:
            yield Suspect(
                parameter.name,
                place_of(structure, parameter.name),
                1.0 - cost / before,
                parameter.unit,
                model.values[parameter.name],
                values[parameter.name],
            )


def _of_sensors(
    model: Model, windows: Sequence[Record], run: FreeRun, noise: Mapping[str, float]
) -> Iterator[Suspect]:
    """Yield another gain and another zero of each sensor, beside a simulation that stays as it is."""
    weighed = {name: residual / noise[name] for name, residual in run.residuals.items()}
    whole = sum(float(own @ own) for own in weighed.values())
    for name, residual in run.residuals.items():
        simulated = np.concatenate([window[name] for window in windows]) - residual
        simulated = simulated - np.mean(simulated)
        size, zero = float(simulated @ simulated), float(np.mean(residual))
        slope = float(simulated @ residual) / size if size > 0.0 else 0.0
        scale = noise[name] ** 2 * whole
        if scale > 0.0:
            unit = model.structure.rig.signal_units[name]
            yield Suspect(f"gain of {name}", name, slope**2 * size / scale, "1", 1.0, 1.0 + slope)
            yield Suspect(f"zero of {name}", name, zero**2 * residual.size / scale, unit, 0.0, zero)
