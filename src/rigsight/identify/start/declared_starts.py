"""Start values that effects and parameters declare: formulas of numbers and sizes of a rig, and values inside of bounds.

At a size of zero, the derivatives say little about where the minimum lies.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

import sympy as sp

from rigsight.effects import Effect, placed_dimension
from rigsight.effects import symbols as canonical
from rigsight.identify.fit.fit_data import FitResult
from rigsight.rigs import Rig, evaluated, joint_of
from rigsight.simulate import Structure, carried_over
from rigsight.units import characteristic_value

_INSIDE = 0.1
"""Start of a parameter that declares none, in characteristic units: of a damping, a damping ratio of 0.05."""


def off_bounds(
    structure: Structure, values: Mapping[str, float], free: Sequence[str], scales: Mapping[str, float]
) -> dict[str, float] | None:
    """Return start values without free parameters at a bound of their range; None if there are none."""
    moved = {
        p.name: min(max(share * characteristic_value(p.dimension, scales), p.lower), p.upper)
        for p in structure.parameters
        if p.name in free and values[p.name] in (p.lower, p.upper)
        for share in (p.starts or (_INSIDE,))[:1]
    }
    return {**values, **moved} if moved else None


def declared_starts(
    structure: Structure,
    effect: Effect,
    scales: Mapping[str, float],
    base: FitResult,
    parents: Mapping[str, FitResult],
) -> Iterator[dict[str, float]]:
    """Yield the start values that an effect declares, beside the fit without it or with one of the effects that it contains."""
    fitted = [p for p in effect.parameters if p.fitted and p.name not in effect.special_cases]
    rest = {p.name: p.default for p in effect.parameters if p not in fitted and p.default is not None}
    rest |= {
        p.name: p.held_at(characteristic_value(placed_dimension(effect, p.dimension), scales))
        for p in effect.parameters
        if not p.fitted
    }
    if effect.starts:
        for start in effect.starts:
            origin = base if start.parent is None else parents.get(start.parent)
            if origin is not None and start.parent != effect.name:
                own = declared_values(
                    structure.rig, effect, start.values, _known(origin, start.parent), scales
                )
                yield with_own_values(structure, effect, origin, {**rest, **own})
        return
    sizes = [characteristic_value(placed_dimension(effect, p.dimension), scales) for p in fitted]
    for combination in itertools.product(*(p.starts for p in fitted)):
        own = {p.name: c * size for p, c, size in zip(fitted, combination, sizes, strict=True)}
        yield with_own_values(structure, effect, base, {**rest, **own})


def _known(origin: FitResult, parent: str | None) -> dict[str, float]:
    """Return the values that a start's formulas may use: the rig's, and the parent effect's by their own names."""
    values = dict(origin.values)
    for effect in origin.structure.effects:
        if effect.name == parent:
            values |= origin.structure.values_of(effect, origin.values)
    return values


def with_own_values(
    structure: Structure, effect: Effect, origin: FitResult, own: Mapping[str, float]
) -> dict[str, float]:
    """Return the values of a fit for a structure with an effect more, with own values of that effect and of the rig."""
    carried = carried_over(origin.values, origin.structure, structure)
    return {**carried, **in_structure(structure, effect, own)}


def declared_values(
    rig: Rig,
    effect: Effect,
    formulas: Mapping[str, sp.Expr],
    values: Mapping[str, float],
    scales: Mapping[str, float],
) -> dict[str, float]:
    """Return the values of the formulas of a declared start, for numbers and sizes of the rig, by the effect's own names."""
    joint = joint_of(rig, effect)
    sizes = {
        base: characteristic_value(placed_dimension(effect, base), scales)
        for base in ("drive", "input", "x", "time")
    }
    numbers = {
        canonical.k: evaluated(joint.stiffness, values),
        canonical.drive_size: sizes["drive"],
        canonical.input_size: sizes["input"],
        canonical.x_size: sizes["x"],
        canonical.v_size: sizes["x"] / sizes["time"],
        canonical.time_size: sizes["time"],
    }
    mechanism = rig.mechanism
    # Of an inertia that changes with the motion its size will do: that where all coordinates are zero.
    at_zero = {**dict.fromkeys((coordinate.name for coordinate in mechanism.coordinates), 0.0), **values}
    if joint.inertia is None and not mechanism.has_short_inverse:
        moved = mechanism.inertia_at(joint.motion, at_zero)
        if moved is not None:
            numbers[canonical.m] = moved
    else:
        inertia = joint.inertia if joint.inertia is not None else mechanism.inertia_along(joint.motion)
        if inertia is not None:
            numbers[canonical.m] = evaluated(inertia, at_zero)
    result = {}
    for name, formula in formulas.items():
        own = {s: values[s.name] for s in formula.free_symbols if s not in numbers}
        value = float(formula.subs({**numbers, **own}))
        if name != "k":
            result[name] = value
        elif isinstance(joint.stiffness, sp.Symbol):
            # A stiffness that several parameters make keeps the values that they have.
            result[str(joint.stiffness.name)] = value
    return result


def in_structure(structure: Structure, effect: Effect, own: Mapping[str, float]) -> dict[str, float]:
    """Return values of an effect, and of the rig, by the names of the structure."""
    names = {p.name: structure.parameter_name(effect, p.name) for p in effect.parameters}
    return {names.get(name, name): value for name, value in own.items()}


def moved_starts(structure: Structure, effect: Effect, values: Mapping[str, float]) -> list[dict[str, float]]:
    """Return what an effect declares for another fit from the values of one, which may have ended in a nearby minimum."""
    own = structure.values_of(effect, values)
    return [
        in_structure(structure, effect, {name: evaluated(f, own) for name, f in start.values.items()})
        for start in effect.starts
        if start.parent == effect.name
    ]
