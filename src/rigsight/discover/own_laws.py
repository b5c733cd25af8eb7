"""Which laws does a discovery hand on as effects of one's own? The powers of its equation, and the shape of what it lacks."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import sympy as sp

from rigsight.discover.along_motion import AlongMotion
from rigsight.discover.bench import Bench, Trial
from rigsight.discover.result import JointForce, OfferedShape
from rigsight.discover.selection import best_with_law
from rigsight.discover.shape import shapes, started
from rigsight.discover.terms import POWERS
from rigsight.effects import Effect, Energy, GainTrend, Place, Signature, kind_of, placed, placed_dimension
from rigsight.effects import symbols as canonical
from rigsight.simulate.model import Model
from rigsight.units import characteristic_value


def own_laws(model: Model, modelled: Sequence[Effect], scales: Mapping[str, float]) -> tuple[Effect, ...]:
    """Return the powers of an equation, which name no cause, as one effect for each joint; their fits start at its numbers."""
    structure, powers = model.structure, dict[str, list[Effect]]()
    for effect in structure.effects:
        if kind_of(effect.name) in POWERS and effect not in modelled:
            powers.setdefault(structure.rig.acts_at(effect), []).append(effect)
    return tuple(
        _sum(f"discovered_law_{number}" if len(powers) > 1 else "discovered_law", joint, own, model, scales)
        for number, (joint, own) in enumerate(powers.items(), start=1)
    )


def _sum(
    name: str, joint: str, powers: Sequence[Effect], model: Model, scales: Mapping[str, float]
) -> Effect:
    parameters = []
    for effect in powers:
        (p,) = effect.parameters
        value = model.values[model.structure.parameter_name(effect, p.name)]
        size = characteristic_value(placed_dimension(effect, p.dimension), scales)
        parameters.append(started(p, value / size))
    torque = sp.Add(*(effect.torque for effect in powers))
    is_spring: bool = torque.free_symbols <= {
        canonical.x,
        *(sp.Symbol(p.name, real=True) for p in parameters),
    }
    return Effect(
        name=name,
        place=Place.DYNAMICS,
        summary=f"What 'rigsight discover' found at {joint} and is in no catalogue: a sum of powers.",
        parameters=tuple(parameters),
        energy=Energy.CONSERVATIVE if is_spring else Energy.ACTIVE,
        signature=Signature(GainTrend.STEADY, any(e.signature.even_harmonics for e in powers)),
        torque=torque,
    )


def offered_shape(
    bench: Bench, along: AlongMotion, equation: Trial, progress: Callable[[str], None]
) -> OfferedShape | None:
    """Return the shape of what an equation lacks, with as many knots as free runs ask for; None where none is clear."""
    found = shapes(along, equation.fit, bench.held_out)
    progress("shape of what is missing")
    laws = [s.effect if bench.rig.has_one_motion else placed(s.effect, s.joint.name) for s in found]
    offered = {
        law.name: (law, shape)
        for law, shape in zip(laws, found, strict=True)
        if law.name not in bench.effects
    }
    if not offered:
        return None
    in_place_of = [(law, shape.in_place_of) for law, shape in offered.values()]
    trial = best_with_law(bench, along, equation, in_place_of, progress)
    if not math.isfinite(trial.error_over_noise):
        return None
    (name,) = trial.support & offered.keys()
    law, shape = offered[name]
    fitted = trial.fit.structure.values_of(law, trial.fit.all_values)
    forces = tuple(fitted[p.name] / along.size("force", shape.joint) for p in law.linear_parameters)
    missing, force = along.missing(trial.fit, shape.joint.name)
    here = tuple(kind_of(e.name) for e in trial.fit.structure.effects if along.is_at(e, shape.joint))
    return OfferedShape(
        effect=replace(shape, forces=forces).effect,
        equation=shape.equation,
        argument=shape.argument,
        in_place_of=tuple(map(kind_of, shape.in_place_of)),
        n_knots=len(shape.sigmoids),
        share=shape.share,
        error_before=equation.error_over_noise,
        error_over_noise=trial.error_over_noise,
        force=JointForce(missing, force, here),
    )
