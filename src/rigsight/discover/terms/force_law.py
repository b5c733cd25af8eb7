"""The equation of a hidden force with memory, as far as the records show it.

The drive minus inertia, damping and the spring without memory is the hysteretic force F. It is the loop's state times a
stiffness, so the rate that the effect declares for its state, ``z' = A x' - ...``, is an equation of F with other coefficients.
Its terms, one for each parameter in which it is linear, are found by regression like any other, together with a relaxing force
and one without memory; this shows which of them the records support. Because a noisy displacement is differentiated twice, this
test fails at noise levels at which the loop itself is still found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.discover.motion import Motion
from rigsight.discover.regression import Projected, inclusion_probabilities
from rigsight.discover.terms.hysteresis import is_loop
from rigsight.discover.weak_form import Rows
from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
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
    forces: Sequence[NDArray[np.float64]],
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
