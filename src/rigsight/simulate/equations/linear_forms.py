"""Linearization of expressions: their derivatives, and sums of changes weighted by them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from rigsight.effects.symbols import derivative
from rigsight.simulate.equations.kinks import absolute

_TINY = sp.Float(1e-300)
"""Added to a magnitude in a divisor or a logarithm: where the magnitude is zero, the finite result is multiplied by zero."""


@dataclass(frozen=True)
class LinearForms:
    """Changes of expressions as sums of products."""

    # Symbol -> the derivative that it denotes; they are the same for all changes.
    factors: Mapping[sp.Symbol, sp.Expr]
    sums: tuple[sp.Expr, ...]  # change of each expression, in terms of factors, constants and changes


def linear_forms(
    expressions: Sequence[sp.Expr], changes: Mapping[sp.Symbol, sp.Expr], constants: set[sp.Symbol]
) -> LinearForms:
    """Return the changes of expressions due to changes of their symbols, with all signs held constant."""
    factors: dict[sp.Expr, sp.Symbol] = {}

    def factor(derivative: sp.Expr) -> sp.Expr:
        if derivative.is_number or derivative in constants:
            return derivative
        return factors.setdefault(derivative, sp.Symbol(f"factor {len(factors)}", real=True))

    sums = []
    for expression in expressions:
        own = [s for s in changes if s in expression.free_symbols]
        terms = [factor(slope(expression, symbol)) * changes[symbol] for symbol in own]
        sums.append(sp.Add(*terms))
    return LinearForms({symbol: derivative for derivative, symbol in factors.items()}, tuple(sums))


@lru_cache(maxsize=16_384)
def slope(expression: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    """Return a derivative that is finite where a magnitude is zero; the derivative of a sign is taken as zero."""
    # Term by term, because sympy takes as long for a derivative that is zero as for another one.
    terms = [term for term in sp.Add.make_args(expression) if symbol in term.free_symbols]
    total = sp.Add(*(_of_term(term, symbol) for term in terms))
    if total.is_Atom:
        return total
    return total.replace(_is_singular, _guarded)


def _of_term(term: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    if term == symbol:
        return sp.S.One
    if term.is_Mul and symbol in term.args:
        others = [factor for factor in term.args if factor != symbol]
        if not any(symbol in factor.free_symbols for factor in others):
            # Most parts of long expressions have this form, for which sympy takes ten times as long.
            return sp.Mul(*others)
    return derivative(term, symbol)


def _is_singular(part: sp.Expr) -> bool:
    if isinstance(part, sp.log):
        return isinstance(part.args[0], (sp.Abs, absolute))
    if not (part.is_Pow and isinstance(part.base, (sp.Abs, absolute))):
        return False
    return bool(part.exp.as_coeff_Add()[0] < 0)


def _guarded(part: sp.Expr) -> sp.Expr:
    if isinstance(part, sp.log):
        return sp.log(part.args[0] + _TINY)
    whole = part.exp + 1
    # The power itself is computed anyway: another logarithm and exponential would cost as much as all other operations.
    return part.base**whole / (part.base + _TINY) if whole.free_symbols else (part.base + _TINY) ** part.exp
