"""Terms and their regression on a rig with one motion: rows of its smoothed acceleration, or of its force if it is prescribed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from rigsight.discover.bench import Bench
from rigsight.discover.ensembles import (
    Examined,
    ForceEquation,
    ForceLaw,
    force_equation,
    inclusion,
    most_likely,
)
from rigsight.discover.hysteresis import is_loop
from rigsight.discover.library import Candidate, along, candidates, distinct, offered_effects
from rigsight.discover.motion import motion_of
from rigsight.discover.regression import Regressed, RegressionData, own_regression, own_terms
from rigsight.discover.selection import Selection
from rigsight.discover.support_starts import PlaceRegression, values_of_one_motion
from rigsight.effects import Place
from rigsight.identify import FitResult, GreyBoxFit, swallowed_by_offsets, without_offsets
from rigsight.records.record import Record
from rigsight.records.signals import is_constant
from rigsight.rigs import evaluated
from rigsight.simulate import compose

_LONGEST_SEED = 3
_SAME_REST = 1e-5
"""Shift of the rest position, in units of the motion, below which the columns do not change."""


@dataclass(frozen=True, eq=False)
class OneMotion:
    """The regression of a rig with one motion."""

    data: RegressionData
    regressed: Regressed
    begun: Bench  # with the library
    same: Mapping[str, list[str]]  # terms that the records do not distinguish from one of the library

    form: ClassVar[str] = "weak"

    @classmethod
    def of(cls, data: RegressionData, bench: Bench, full: bool, pointwise: bool) -> OneMotion:
        """Smooth the motion and regress it; in the full form the rig's own terms compete."""
        rig, output = data.rig, data.rig.outputs[0].name
        swallowed, centered = _offsets_found(data, bench)
        motions = bench.threads.results(
            lambda index: motion_of(rig, centered[index], bench.values, data.noise[output]),
            [record.n_samples for record in bench.estimation],
        )
        regressed = Regressed.of(rig, data.has_stiffness, motions, bench.scales, pointwise, bench.threads)
        projected = regressed.projected
        library, same = distinct(_library(data, regressed), projected)
        place = PlaceRegression(
            projected,
            tuple(candidate.name for candidate in library),
            partial(values_of_one_motion, rig, bench.values),
            _LONGEST_SEED,
        )
        begun = replace(
            bench,
            held=bench.held | swallowed,
            candidates={candidate.name: candidate for candidate in library},
            places=(place,),
            own_terms=own_terms(rig, data.has_stiffness, projected) if full else {},
        )
        return cls(data, regressed, begun, same)

    def about(self, bench: Bench, _: FitResult) -> Bench:
        """Return the bench as it is: its columns do not depend on the equation."""
        return bench

    def examined(
        self, bench: Bench, selection: Selection, final: FitResult, rng: np.random.Generator
    ) -> Examined:
        """Return inclusion probabilities and the equation of the hysteretic force.

        The columns are computed about the rest position of the polished equation: about any other, a cubic spring has a quadratic
        part.
        """
        data, (place,) = self.data, bench.places
        names = most_likely(bench, place, selection, final)
        shift = _rest_shift(bench, final)
        library = [bench.candidates[name] for name in names]
        if abs(shift) >= _SAME_REST * bench.scales["x"]:
            moved = [replace(m, x=m.x - shift, measured=m.measured - shift) for m in self.regressed.motions]
            projected = own_regression(data.rig, data.has_stiffness, moved, self.regressed.rows)
            # The columns of loops do not depend on the rest position.
            loops = [candidate for candidate in library if is_loop(candidate.effect)]
            effects = [candidate.effect for candidate in library if not is_loop(candidate.effect)]
            library = loops + candidates(effects, replace(self.regressed, motions=moved, projected=projected))
            place = replace(place, projected=projected)
        again = replace(
            bench,
            candidates={candidate.name: candidate for candidate in library},
            own_terms=own_terms(data.rig, data.has_stiffness, place.projected) if bench.own_terms else {},
        )
        included = inclusion(again, place, list(again.candidates), rng)
        return Examined(included, regressed_force(bench, final, self.regressed, rng))


def _offsets_found(data: RegressionData, bench: Bench) -> tuple[frozenset[str], Sequence[Record]]:
    """Return the parameters that the records' offsets can replace, and the records without the offsets of a first fit."""
    records, scales = bench.estimation, bench.scales
    if not any(record.free_offsets for record in records):
        return frozenset(), records
    structure = compose(bench.rig)
    asked = [p.name for p in data.rig.parameters if p.name in structure.names and p.name not in bench.held]
    known = {name: bench.values[name] for name in structure.names}
    swallowed = frozenset(swallowed_by_offsets(structure, records, scales, data.noise, known, asked))
    free = [name for name in asked if name not in swallowed]
    fit = GreyBoxFit(structure, records, scales, data.noise).fit(known, free, finish=False)
    return swallowed, without_offsets(records, fit)


def _library(data: RegressionData, regressed: Regressed) -> list[Candidate]:
    effects = offered_effects(data.rig, data.has_stiffness)
    if all(is_constant(motion.u) for motion in regressed.motions):
        effects = [effect for effect in effects if effect.place is not Place.ACTUATOR]
    found = candidates(effects, regressed)
    return [c for c in found if np.all(np.isfinite(c.column)) and np.any(c.column)]


def regressed_force(
    bench: Bench, final: FitResult, regressed: Regressed, rng: np.random.Generator
) -> ForceEquation | None:
    """Regress the equation of the hysteretic force, the residual of the polished model's other forces along the motion."""
    rig, values = bench.rig, {**dict(final.structure.fixed), **final.values}
    laws = [law for law in map(ForceLaw.of, final.structure.effects) if law is not None]
    if not laws or not rig.is_driven:
        return None
    law = laws[0]
    others = [effect for effect in final.structure.effects if effect is not law.effect]
    if any(effect.torque is None for effect in others):
        return None
    motion = rig.motion
    gain, bias, inertia, damping, stiffness = (
        evaluated(part, values)
        for part in (motion.drive_gain, motion.bias, motion.inertia, motion.damping, motion.stiffness)
    )
    own_values = final.structure.values_of(law.effect, values)
    assert law.effect.post_yield_stiffness_ratio is not None
    without_memory = own_values[law.effect.post_yield_stiffness_ratio] * stiffness
    # Springs act about the polished rest position, not about the one about which the motion was smoothed.
    shift = _rest_shift(bench, final)
    moved = [replace(own, x=own.x - shift) for own in regressed.motions]
    forces = []
    for own in moved:
        force = gain * own.u + bias - inertia * own.acceleration
        force -= damping * own.v + without_memory * own.x
        for effect in others:
            force -= along(effect.torque, final.structure.values_of(effect, values), own)
        forces.append(force)
    return force_equation(law, moved, regressed.rows, forces, own_values, rng)


def _rest_shift(bench: Bench, final: FitResult) -> float:
    """Return the distance of the polished rest position from the one about which the motion was smoothed."""
    motion = bench.rig.motion
    if not bench.rig.is_driven:
        return 0.0
    return sum(final.values[s.name] - bench.values[s.name] for s in motion.rest.free_symbols)
