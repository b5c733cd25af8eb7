"""Start values of the fit of a support: those of the regression, or the result of a shorter support."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp

from rigsight.discover.hysteresis import is_loop
from rigsight.discover.library import Candidate
from rigsight.discover.regression import Projected
from rigsight.identify import FitResult
from rigsight.records.record import Floats
from rigsight.rigs import Rig, evaluated
from rigsight.rigs.rig import joint_of
from rigsight.simulate import Structure, carried_over

_SMALL = 1e-3
"""Smallest share at which a fit starts a resisting force, or one part of a spring relative to the other."""


@dataclass(frozen=True, eq=False)
class PlaceRegression:
    """What is regressed at a joint of a rig, or on the only motion of a rig."""

    projected: Projected
    offered: tuple[str, ...]  # names of the terms that have a column
    # The rig's parameters from the coefficients of its own terms, and the force per unit of the other coefficients.
    rig_values: Callable[[Floats], tuple[dict[str, float], float]]
    longest: int  # number of terms that are proposed together at most


@dataclass(frozen=True, eq=False)
class SupportStarts:
    """Start values of supports."""

    rig: Rig
    values: Mapping[str, float]  # constants and parameters without any term
    candidates: Mapping[str, Candidate]  # the library, by name
    places: Sequence[PlaceRegression]
    about: FitResult | None  # the equation whose residual is regressed; None for that without any term

    def regressed(self, structure: Structure, support: frozenset[str]) -> dict[str, float]:
        """Return the values of the regression for a support, in SI."""
        values = dict(self.values)
        for place in self.places:
            chosen = [self.candidates[name] for name in sorted(support & {*place.offered})]
            # Beside other joints a joint without a term says nothing about the rig.
            if not chosen and len(self.places) > 1:
                continue
            columns = [candidate.column for candidate in chosen]
            solution, _ = place.projected.solved(
                np.column_stack([np.zeros((place.projected.target.size, 0)), *columns])
            )
            n_own = place.projected.base.shape[1]
            own, force = place.rig_values(solution[:n_own])
            values |= own
            for candidate, coefficient in zip(chosen, solution[n_own:] * force, strict=True):
                values |= self._effect_values(structure, candidate, float(coefficient), values)
        if self.about is not None:
            known = {effect.name for effect in self.about.structure.effects}
            carried = carried_over(self.about.values, self.about.structure, structure)
            values |= carried if support <= known else {n: v for n, v in carried.items() if n not in values}
        return _within_bounds(structure, values)

    def extended(self, structure: Structure, support: frozenset[str], shorter: FitResult) -> dict[str, float]:
        """Return the fitted values of a support with fewer terms, in SI.

        The coefficients of the terms that it lacks are zero, so that the fit begins where the shorter one ended. Nonlinear
        parameters of these terms, and the division of a spring into parts with and without memory, come from the regression.
        """
        values = self.regressed(structure, support)
        carried = carried_over(shorter.values, shorter.structure, structure)
        added = [effect for effect in structure.effects if effect not in shorter.structure.effects]
        for effect in added:
            if is_loop(effect):
                carried.pop(str(joint_of(self.rig, effect).stiffness), None)
        for effect in added:
            for parameter in effect.parameters:
                if parameter.name in self.candidates[effect.name].linear and parameter.null is not None:
                    carried[structure.parameter_name(effect, parameter.name)] = parameter.null
        return _within_bounds(structure, {**values, **carried})

    def _effect_values(
        self, structure: Structure, candidate: Candidate, coefficient: float, values: Mapping[str, float]
    ) -> dict[str, float]:
        effect = candidate.effect
        own = {p.name: p.default for p in effect.parameters if p.default is not None}
        own |= candidate.inner
        own |= {name: share * coefficient for name, share in candidate.linear.items()}
        found: dict[str, float] = {}
        if is_loop(effect):
            assert effect.post_yield_stiffness_ratio is not None
            stiffness = joint_of(self.rig, effect).stiffness
            without = max(evaluated(stiffness, values), _SMALL * coefficient)
            total = without + max(coefficient, _SMALL * without)
            # A stiffness that is no parameter of its own is left to the fit.
            found |= {stiffness.name: total} if isinstance(stiffness, sp.Symbol) else {}
            own[effect.post_yield_stiffness_ratio] = without / total
        for parameter in effect.parameters:
            if parameter.name in candidate.linear and parameter.lower == 0.0:
                # A resisting force with the wrong sign in the regression is negligible.
                own[parameter.name] = max(own[parameter.name], _SMALL * abs(own[parameter.name]))
            if parameter.name in own:
                found[structure.parameter_name(effect, parameter.name)] = own[parameter.name]
        return found


def _within_bounds(structure: Structure, values: Mapping[str, float]) -> dict[str, float]:
    bounds = {p.name: p for p in structure.parameters}
    return {
        name: float(np.clip(value, bounds[name].lower, bounds[name].upper))
        for name, value in values.items()
        if name in bounds
    }


def values_of_one_motion(
    rig: Rig, known: Mapping[str, float], base: Floats
) -> tuple[dict[str, float], float]:
    """Return the rig's parameters from the coefficients of its own terms, and the force per unit of the other coefficients."""
    values = dict(known)
    motion = rig.motion
    if not rig.is_driven:
        values |= {motion.damping.name: base[0], motion.stiffness.name: base[1], motion.bias.name: base[2]}
        return values, 1.0
    gain = evaluated(motion.drive_gain, known)
    assert motion.inertia is not None
    inertia = gain / base[0] if base[0] * gain > 0.0 else known[motion.inertia.name]
    values[motion.inertia.name] = inertia
    values[motion.damping.name] = max(base[1] * inertia, 1e-4 * known[motion.damping.name])
    if len(base) == 4:
        stiffness = max(base[2] * inertia, 1e-3 * known[motion.stiffness.name])
        values[motion.stiffness.name] = stiffness
        values[motion.rest.name] = known[motion.rest.name] + base[3] * inertia / stiffness
    else:
        for symbol in motion.bias.free_symbols:
            values[symbol.name] = base[2] * inertia
    return values, inertia
