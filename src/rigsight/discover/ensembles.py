"""Inclusion probability of each term: regressions of resampled rows about the rest position of the refitted equation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import sympy as sp

from rigsight.discover.bench import Bench
from rigsight.discover.motion import Motion
from rigsight.discover.regression import RegressionData, inclusion_probabilities, own_regression, own_terms
from rigsight.discover.selection import Selection, proposals
from rigsight.discover.terms.force_law import ForceEquation, ForceLaw, force_equation
from rigsight.discover.terms.hysteresis import is_loop
from rigsight.discover.terms.library import candidates, torque_along
from rigsight.discover.weak_form import Rows
from rigsight.identify import FitResult

_ENSEMBLE_TERMS = 6
_SAME_REST = 1e-5
"""Shift of the rest position, in units of the motion, below which the columns do not change."""


def inclusion(
    data: RegressionData,
    bench: Bench,
    selection: Selection,
    final: FitResult,
    motions: Sequence[Motion],
    rows: Rows,
    rng: np.random.Generator,
) -> dict[str, float]:
    """Return the inclusion probability of the most likely terms, and of the rig's own in the full form.

    The columns are computed about the rest position of the polished equation: about any other, a cubic spring has a quadratic
    part.
    """
    polished = [name for trial in selection.trials for name in sorted(trial.support)]
    proposed = [name for support in proposals(bench) for name in sorted(support)]
    shares = {n: bench.projected.explained(c.column[:, None])[1] for n, c in bench.candidates.items()}
    ranked = sorted(shares, key=lambda name: -shares[name])
    kept = set(final.structure.effect_names)
    # An effect that contains a selected one as a special case explains the same, and would only split its share of the draws.
    offered_terms = [
        name
        for name in dict.fromkeys((*polished, *proposed, *ranked))
        if name in kept or not kept & _ancestors(bench, name)
    ]
    names = offered_terms[:_ENSEMBLE_TERMS]
    shift = _rest_shift(bench, final)
    if abs(shift) < _SAME_REST * bench.scales["x"]:
        shift = 0.0
    moved = [replace(m, x=m.x - shift, measured=m.measured - shift) for m in motions] if shift else motions
    projected = own_regression(data.rig, data.has_stiffness, moved, rows) if shift else bench.projected
    own_columns = own_terms(data.rig, data.has_stiffness, projected) if bench.own_terms else {}
    library = [bench.candidates[name] for name in names]
    if shift:
        # The columns of loops do not depend on the rest position.
        loops = [candidate for candidate in library if is_loop(candidate.effect)]
        effects = [candidate.effect for candidate in library if not is_loop(candidate.effect)]
        library = loops + candidates(
            effects, moved, rows, projected, bench.scales, data.rig.is_driven, bench.threads
        )
    again = replace(
        bench,
        candidates={candidate.name: candidate for candidate in library},
        projected=projected,
        own_terms=own_columns,
    )
    offered = [*own_columns, *again.candidates]
    if not offered:
        return {}
    columns = np.column_stack([again.column(name) for name in offered])
    found = inclusion_probabilities(again.sparse, columns, rng)
    return dict(zip(offered, map(float, found), strict=True))


def regressed_force(
    bench: Bench, final: FitResult, motions: Sequence[Motion], rows: Rows, rng: np.random.Generator
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

    def number(expression: sp.Expr) -> float:
        return float(expression.subs({s: values[s.name] for s in expression.free_symbols}))

    own_values = final.structure.values_of(law.effect, values)
    assert law.effect.post_yield_stiffness_ratio is not None
    without_memory = own_values[law.effect.post_yield_stiffness_ratio] * number(motion.stiffness)
    # Springs act about the polished rest position, not about the one about which the motion was smoothed.
    shift = _rest_shift(bench, final)
    moved = [replace(own, x=own.x - shift) for own in motions]
    forces = []
    for own in moved:
        force = (
            number(motion.drive_gain) * own.u
            + number(motion.bias)
            - number(motion.inertia) * own.acceleration
        )
        force -= number(motion.damping) * own.v + without_memory * own.x
        for effect in others:
            force -= torque_along(effect, final.structure.values_of(effect, values), own)
        forces.append(force)
    return force_equation(law, moved, rows, forces, own_values, rng)


def _ancestors(bench: Bench, name: str) -> set[str]:
    """Return the effects that are special or limiting cases of a term, and recursively their special cases."""
    parents = [parent for parent in bench.candidates[name].effect.parents if parent in bench.candidates]
    return set(parents).union(*(_ancestors(bench, parent) for parent in parents))


def _rest_shift(bench: Bench, final: FitResult) -> float:
    """Return the distance of the polished rest position from the one about which the motion was smoothed."""
    motion = bench.rig.motion
    if not bench.rig.is_driven:
        return 0.0
    return sum(final.values[s.name] - bench.values[s.name] for s in motion.rest.free_symbols)
