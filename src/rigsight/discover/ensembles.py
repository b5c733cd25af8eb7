"""Inclusion probability of each term, and of each term in the equation of a hidden force with memory.

Terms are regressed on resampled rows about the rest position of the refitted equation. Of a loop, the drive minus inertia,
damping and the spring without memory is the hysteretic force F. It is the loop's state times a stiffness, so the rate that
the effect declares for its state, ``z' = A x' - ...``, is an equation of F with other coefficients. Its terms, one for each
parameter in which it is linear, are found by regression like any other, together with a relaxing force and one without
memory; this shows which of them the records support. Because a noisy displacement is differentiated twice, this test fails at
noise levels at which the loop itself is still found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from rigsight.discover.bench import Bench
from rigsight.discover.hysteresis import is_loop
from rigsight.discover.motion import Motion, Rows
from rigsight.discover.regression import Projected, inclusion_probabilities
from rigsight.discover.result import JointForce
from rigsight.discover.selection import Selection, proposals
from rigsight.discover.support_starts import PlaceRegression
from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.identify import FitResult
from rigsight.records.record import Floats
from rigsight.simulate.printing.notation import TermPrinter

_FORCE = sp.Symbol("F", real=True)
_RATE = sp.Symbol("x'", real=True)
_DISPLACEMENT = sp.Symbol("x", real=True)
_RIVALS = (-_FORCE, _DISPLACEMENT)
"""A force that relaxes, and one without memory: terms that no loop has."""


@dataclass(frozen=True)
class ForceLaw:
    """The equation that the force of a loop with one free state obeys."""

    effect: Effect  # the loop
    terms: Mapping[str, sp.Expr]  # right-hand side per unit of each coefficient, by its printed name
    parameters: Mapping[str, str]  # the parameter of each of the effect's own terms, by the same names

    @classmethod
    def of(cls, effect: Effect) -> ForceLaw | None:
        """Derive the equation from the rate that an effect declares; None if its force is not a single state without limit."""
        if not is_loop(effect) or len(effect.states) != 1 or effect.states[0].limit is not None:
            return None
        (state,) = effect.states
        written = {
            state.symbol: _FORCE,
            canonical.deflection_rate: _RATE,
            canonical.deflection: _DISPLACEMENT,
        }
        terms: dict[str, sp.Expr] = {}
        parameters: dict[str, str] = {}
        for parameter in effect.parameters:
            symbol = sp.Symbol(parameter.name, real=True)
            slope = derivative(state.rate, symbol)
            if slope != 0 and not slope.has(symbol):
                term = slope.xreplace(written)
                terms[_name(term)], parameters[_name(term)] = term, parameter.name
        terms |= {_name(term): term for term in _RIVALS if _name(term) not in terms}
        return cls(effect, terms, parameters)


@dataclass(frozen=True)
class ForceEquation:
    """The regressed equation of the hysteretic force."""

    law: ForceLaw  # the terms offered to the regression
    # By term of the law [SI].
    coefficients: Mapping[str, float]
    inclusion: Mapping[str, float]
    share: float  # share of the force's rate that the equation explains


def force_equation(
    law: ForceLaw,
    motions: Sequence[Motion],
    rows: Rows,
    forces: Sequence[Floats],
    values: Mapping[str, float],
    rng: np.random.Generator,
) -> ForceEquation:
    """Regress the equation of the hysteretic force."""
    numbers = {sp.Symbol(name, real=True): value for name, value in values.items()}
    signals = [sp.lambdify((_DISPLACEMENT, _RATE, _FORCE), term.subs(numbers)) for term in law.terms.values()]
    target = [rows.rate_of(force, motion.dt) for motion, force in zip(motions, forces, strict=True)]
    matrix = np.concatenate(
        [
            np.column_stack([rows.of(signal(motion.x, motion.v, force), motion.dt) for signal in signals])
            for motion, force in zip(motions, forces, strict=True)
        ]
    )
    rate = np.concatenate(target)
    # Only a constant rate is projected out, which no force can have for long.
    independent = sum(
        own.size * rows.independent_share(1, motion.dt) for own, motion in zip(target, motions, strict=True)
    )
    projected = Projected(np.ones((rate.size, 1)), rate, independent)
    inclusion = inclusion_probabilities(projected, matrix, rng)
    taken = inclusion >= 0.5
    coefficients = np.zeros(len(law.terms))
    share = 0.0
    if np.any(taken):
        coefficients[taken], share = projected.explained(matrix[:, taken])
    return ForceEquation(
        law,
        dict(zip(law.terms, map(float, coefficients), strict=True)),
        dict(zip(law.terms, map(float, inclusion), strict=True)),
        share,
    )


def _name(term: sp.Expr) -> str:
    """Return a term without its sign, the velocity first and the force itself last."""

    def place(factor: sp.Expr) -> Any:
        return not factor.has(_RATE), factor == _FORCE, str(factor)

    factors = [f for f in sp.Mul.make_args(term) if not f.is_number]
    return " ".join(TermPrinter().doprint(factor) for factor in sorted(factors, key=place))


_ENSEMBLE_TERMS = 6


@dataclass(frozen=True, eq=False)
class Examined:
    """What the regression says of the final equations."""

    inclusion: Mapping[str, float]  # inclusion probability of the most likely terms, by name
    force: ForceEquation | None = None  # of the hysteretic force
    joints: tuple[JointForce, ...] = ()  # the force missing at each joint of several


def most_likely(bench: Bench, place: PlaceRegression, selection: Selection, final: FitResult) -> list[str]:
    """Return the names of the terms at a place that compete in an ensemble: the kept ones, and the best others."""
    polished = [name for trial in selection.trials for name in sorted(trial.support)]
    proposed = [name for support in proposals(bench) for name in sorted(support)]
    shares = {n: place.projected.explained(bench.candidates[n].column[:, None])[1] for n in place.offered}
    ranked = sorted(shares, key=lambda name: -shares[name])
    kept = set(final.structure.effect_names)
    # An effect that contains a selected one as a special case explains the same, and would only split its share of the draws.
    names = [
        name
        for name in dict.fromkeys((*polished, *proposed, *ranked))
        if name in shares and (name in kept or not kept & _ancestors(bench, name))
    ]
    return names[:_ENSEMBLE_TERMS]


def inclusion(
    bench: Bench, place: PlaceRegression, names: Sequence[str], rng: np.random.Generator
) -> dict[str, float]:
    """Return the inclusion probability of terms at a place, and of the rig's own in the full form."""
    offered = [*bench.own_terms, *names]
    if not offered:
        return {}
    columns = np.column_stack([bench.column(name) for name in offered])
    found = inclusion_probabilities(bench.sparse(place.projected), columns, rng)
    return dict(zip(offered, map(float, found), strict=True))


def _ancestors(bench: Bench, name: str) -> set[str]:
    """Return the effects that are special or limiting cases of a term, and recursively their special cases."""
    parents = [parent for parent in bench.candidates[name].effect.parents if parent in bench.candidates]
    return set(parents).union(*(_ancestors(bench, parent) for parent in parents))
