"""Accelerations whose formulas would be too long: numerical elimination in named steps.

``mass @ accelerations = loads`` is solved by ``mass = L D L'``, with ones on the diagonal of L. This needs no square root,
because parameters tried during a fit may give an indefinite mass matrix.

G. H. Golub and C. F. Van Loan, Matrix Computations (2013), 4.1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import islice

import sympy as sp

from rigsight.effects.symbols import positive_part
from rigsight.simulate.equations.straight_line import StraightLine, straight_line

_SHORT = 40
"""Length of a force (its numbers, symbols and operations) up to which parts in common with other forces are not searched."""
_KINKS = (sp.Abs, sp.sign, positive_part)


def acceleration_symbols(count: int) -> tuple[sp.Symbol, ...]:
    """Return the symbols of accelerations that are computed by elimination."""
    return tuple(_symbol("acceleration", i) for i in range(count))


@dataclass(frozen=True)
class Elimination:
    """The steps that lead from a mass matrix and loads to accelerations."""

    # Symbol of each entry of the lower half that is not zero, by row and column.
    mass: Mapping[tuple[int, int], sp.Symbol]
    size: int  # number of degrees of freedom

    @classmethod
    def of(cls, mass: sp.ImmutableMatrix) -> Elimination:
        """Return the elimination of a mass matrix, without its zero entries."""
        entries = [(i, j) for i in range(mass.rows) for j in range(i + 1) if mass[i, j] != 0]
        return cls({(i, j): _symbol("mass", i, j) for i, j in entries}, mass.rows)

    @property
    def loads(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the generalized forces."""
        return tuple(_symbol("load", i) for i in range(self.size))

    @property
    def accelerations(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the accelerations."""
        return acceleration_symbols(self.size)

    def solution(self, name: str) -> tuple[sp.Symbol, ...]:
        """Return the symbols of the solution with a given name."""
        return tuple(_symbol(name, i) for i in range(self.size))

    @property
    def entries(self) -> list[sp.Expr]:
        """The mass matrix row by row, as symbols and zeros."""
        places = [(max(i, j), min(i, j)) for i in range(self.size) for j in range(self.size)]
        return [self.mass.get(place, sp.S.Zero) for place in places]

    @property
    def left(self) -> list[sp.Expr]:
        """The load minus mass times acceleration of each row, which is zero in motion."""
        return [load - sp.Add(*(mass * a for mass, a in self.moved(i))) for i, load in enumerate(self.loads)]

    def moved(self, index: int) -> tuple[tuple[sp.Symbol, sp.Symbol], ...]:
        """Return the nonzero masses in a row of the matrix, each with the acceleration by which it is multiplied."""
        row = ((self.mass.get((max(index, j), min(index, j))), a) for j, a in enumerate(self.accelerations))
        return tuple((mass, a) for mass, a in row if mass is not None)

    @cached_property
    def steps(self) -> dict[sp.Symbol, sp.Expr]:
        """Symbol -> its expression in masses, loads and earlier symbols; the accelerations come last."""
        solved = self.solved(self.loads, "acceleration")
        return {**self._factors[1], **solved}

    def begun(self, steps: Mapping[sp.Symbol, sp.Expr]) -> dict[sp.Symbol, sp.Expr]:
        """Return the first steps to the accelerations: those up to masses and loads."""
        return {symbol: step for symbol, step in steps.items() if symbol not in self.steps}

    def solved(self, loads: Sequence[sp.Expr], name: str) -> dict[sp.Symbol, sp.Expr]:
        """Return the steps that solve the system for other loads, with the existing factors of the matrix."""
        (factors, _), n = self._factors, self.size
        found: dict[sp.Symbol, sp.Expr] = {}
        forward = [_symbol(f"{name} forward", i) for i in range(n)]
        for i, load in enumerate(loads):
            found[forward[i]] = load - sp.Add(
                *(factors[i, k] * forward[k] for k in range(i) if (i, k) in factors)
            )
        solution = self.solution(name)
        for i in reversed(range(n)):
            above = (factors[k, i] * solution[k] for k in range(i + 1, n) if (k, i) in factors)
            found[solution[i]] = forward[i] * _symbol("mobility", i) - sp.Add(*above)
        return found

    @cached_property
    def _factors(self) -> tuple[dict[tuple[int, int], sp.Symbol], dict[sp.Symbol, sp.Expr]]:
        """The symbols of L below its diagonal, and the steps to them and to the inverse of D."""
        factors: dict[tuple[int, int], sp.Symbol] = {}
        rows: dict[tuple[int, int], sp.Symbol] = {}
        steps: dict[sp.Symbol, sp.Expr] = {}
        for j in range(self.size):
            for i in range(j, self.size):
                before = [
                    factors[j, k] * rows[i, k] for k in range(j) if (j, k) in factors and (i, k) in rows
                ]
                left = self.mass.get((i, j), sp.S.Zero) - sp.Add(*before)
                if i == j:
                    steps[_symbol("mobility", j)] = 1 / left
                elif left != 0:
                    rows[i, j], factors[i, j] = _symbol("row", i, j), _symbol("share", i, j)
                    steps[rows[i, j]] = left
                    steps[factors[i, j]] = rows[i, j] * _symbol("mobility", j)
        return factors, steps


def steps_to_accelerations(
    elimination: Elimination, masses: Sequence[sp.Expr], loads: Sequence[Sequence[sp.Expr]]
) -> dict[sp.Symbol, sp.Expr]:
    """Return all steps to the accelerations, from the expressions in the equations of motion."""
    every = [term for terms in loads for term in terms]
    long = [term for term in every if any(True for _ in islice(sp.preorder_traversal(term), _SHORT, None))]
    shared = _shared(tuple(e for e in (*masses, *long) if not e.has(*_KINKS)))
    short = dict(zip(shared[0], shared[1].results, strict=True))
    return {
        **shared[1].parts,
        **{s: short.get(e, e) for s, e in zip(elimination.mass.values(), masses, strict=True)},
        **{
            load: sp.Add(*(short.get(term, term) for term in terms))
            for load, terms in zip(elimination.loads, loads, strict=True)
        },
        **elimination.steps,
    }


@lru_cache(maxsize=64)
def _shared(expressions: tuple[sp.Expr, ...]) -> tuple[tuple[sp.Expr, ...], StraightLine]:
    """Return expressions and their parts; those of a rig do not depend on its effects."""
    return expressions, straight_line(expressions, name="inner")


def _symbol(name: str, *indices: int) -> sp.Symbol:
    # Names of a rig contain no blank, so there is no conflict.
    return sp.Symbol(" ".join([name, *map(str, indices)]), real=True)
