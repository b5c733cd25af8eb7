"""Which function of one argument is missing at a joint, whatever its form? A sum of sigmoids along the measured motion.

A sigmoid is a force that grows with the displacement or the velocity up to a knot, on both sides of rest or on one, and stays
there. The records choose the knots: stepwise regression drops one after the other, and the motion of held-out records judges what
remains.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp

from rigsight.discover.along_motion import AlongMotion
from rigsight.discover.selection import STRONG
from rigsight.discover.stability import information_criterion, supports_by_size
from rigsight.effects import Effect, Energy, GainTrend, Place, Signature
from rigsight.effects import symbols as canonical
from rigsight.errors import SimulationError
from rigsight.identify import FitResult
from rigsight.inverse.effect_terms import EffectTerms
from rigsight.inverse.equation_fit import per_force
from rigsight.inverse.joint_force import joint_motion
from rigsight.inverse.measured_motion import WIDER
from rigsight.inverse.regression import Regression
from rigsight.inverse.selection import WORTH
from rigsight.inverse.term import compiled
from rigsight.parameters import Parameter
from rigsight.records import Record
from rigsight.records.record import Floats
from rigsight.rigs import Joint

_KNOTS = tuple(float(f"{10.0 ** (i / 8):.2g}") for i in range(-11, 1))
"""Knots among which records choose, eight per decade, in units of the size of the motion."""
_OFFERED = tuple((knot, side) for side in (0, 1, -1) for knot in _KNOTS)
"""Sigmoids: each knot, on both sides of rest (0) or where the argument has this sign."""
_MOST = 8
"""Sigmoids of a shape at most."""
_FURTHEST = 1.5
"""How far a search goes, in units of the number found."""
_DIGITS = 4
_SIGNALS: Mapping[str, tuple[sp.Symbol, ...]] = {
    "displacement": (canonical.x, canonical.position, canonical.deflection, canonical.spring_torque, canonical.k),
    "velocity": (canonical.v,),
}  # fmt: skip
"""What a law of each argument may read; the first is the argument."""
_SIGNS = {0: "+-", 1: "+", -1: "-"}
_DIMENSIONS = {"displacement": "x", "velocity": "x time^-1"}


@dataclass(frozen=True, eq=False)
class Shape:
    """A law of one argument at a joint, as a sum of sigmoids."""

    joint: Joint
    argument: str  # displacement or velocity
    size: float  # of the argument in the records
    in_place_of: tuple[str, ...]  # laws of the same argument that the equation has there
    sigmoids: tuple[int, ...]  # their places among those offered
    forces: tuple[float, ...]  # of each sigmoid, in units of the size of the force at the joint
    share: float  # of the square of the missing force along the held-out motion that it explains

    @property
    def effect(self) -> Effect:
        """The law as an effect without a place; its knots are in units of the size of the motion, as its forces are."""
        parameters = []
        for name, i, force in zip(self._names, self.sigmoids, self.forces, strict=True):
            knot, side = _OFFERED[i]
            what = f"force gained up to {_SIGNS[side]}{knot:g} {self._size}"
            parameters.append(started(Parameter(name, what, "force", null=0.0), force))
        reference = Parameter(
            str(self._size), f"size of the {self.argument}, a convention", _DIMENSIONS[self.argument], lower=1e-12,
            upper=1e12, default=_short(self.size), starts=(1.0,), search=(1e-3, 1e3), fitted=False,
        )  # fmt: skip
        return Effect(
            name=f"shape_over_{self.argument}_{len(self.sigmoids)}",
            place=Place.DYNAMICS,
            summary=f"A force that is a function of the {self.argument}, of the shape that records showed.",
            parameters=(*parameters, reference),
            energy=Energy.CONSERVATIVE if self.argument == "displacement" else Energy.ACTIVE,
            signature=Signature(GainTrend.STEADY, even_harmonics=any(_OFFERED[i][1] for i in self.sigmoids)),
            torque=self._sum_of(canonical.sigmoid),
        )

    @property
    def equation(self) -> str:
        """Its force as Python text."""
        return str(self._sum_of(sp.Function(canonical.sigmoid.__name__)))

    def _sum_of(self, sigmoid: Callable[..., sp.Expr]) -> sp.Expr:
        symbol, total = _SIGNALS[self.argument][0], sp.S.Zero
        for name, (knot, side) in zip(self._names, (_OFFERED[i] for i in self.sigmoids), strict=True):
            total += sp.Symbol(name, real=True) * sigmoid(
                symbol, knot * self._size, *([side] if side else [])
            )
        return total

    @property
    def _size(self) -> sp.Symbol:
        return sp.Symbol(f"{_SIGNALS[self.argument][0]}_r", real=True)

    @property
    def _names(self) -> list[str]:
        return [f"T_{number}" for number in range(1, len(self.sigmoids) + 1)]


@dataclass(frozen=True, eq=False)
class _Rows:
    """Equations along motions: columns of what stays beside a shape, those of sigmoids, and the missing force."""

    beside: Floats
    sigmoids: Floats
    missing: Floats

    def columns(self, chosen: Sequence[int]) -> Floats:
        return np.column_stack([self.beside, self.sigmoids[:, list(chosen)]])

    def left(self, chosen: Sequence[int], numbers: Floats) -> float:
        """Return the mean square that sigmoids with their numbers leave."""
        return float(np.mean((self.missing - self.columns(chosen) @ numbers) ** 2))

    def fitted(self, chosen: Sequence[int]) -> Floats:
        """Return the numbers of what stays and of sigmoids that leave least."""
        columns = self.columns(chosen)
        size = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(np.float64).tiny)
        return np.asarray(np.linalg.lstsq(columns / size, self.missing, rcond=1e-12)[0] / size)

    def supports(self) -> list[tuple[int, ...]]:
        """Return the sigmoids that stepwise regression leaves of those on both sides, and of all, the fewest first."""
        q = np.linalg.qr(self.beside)[0]
        sigmoids, missing = (own - q @ (q.T @ own) for own in (self.sigmoids, self.missing))
        found = {
            support
            for offered in (sigmoids[:, : len(_KNOTS)], sigmoids)
            for support in supports_by_size(offered, missing)
            if len(support) <= _MOST
        }
        return [(), *sorted(found, key=len)]


def shapes(along: AlongMotion, fit: FitResult, held_out: Sequence[Record]) -> list[Shape]:
    """Return the laws of one argument at one joint, the best of each number of knots, the fewest first.

    Joint, argument and the largest number are those that explain most of the missing force along held-out records. Nothing where
    these do not show the motion, or no shape explains clearly more there than the laws of the equation.
    """
    try:
        unseen = along.terms_of.along_records(held_out)
    except SimulationError:
        return []
    equation = _Equation.along_records(along, fit, (along.terms_of, unseen))
    seen, held = equation.rows((), along.rig.mechanism.joints[0], "velocity")
    lowest, enough = equation.cost(seen, held) - STRONG, (1.0 - WORTH) * held.left((), seen.fitted(()))
    found = list[Shape]()
    for joint, argument in itertools.product(along.rig.mechanism.joints, _SIGNALS):
        there = equation.laws_at(joint, argument)
        seen, held = equation.rows(there, joint, argument)
        supports = sorted(seen.supports(), key=lambda own: (len(own), equation.cost(seen, held, own)))
        costs = [equation.cost(seen, held, own) for own in supports]
        if min(costs) < lowest:
            lowest = min(costs)
            lasting = [own for i, own in enumerate(supports) if costs[i] < min(costs[:i], default=math.inf)]
            clear = [own for own in lasting if own and held.left(own, seen.fitted(own)) < enough]
            found = [equation.shape(joint, argument, there, own, seen, held) for own in clear]
    return found


@dataclass(frozen=True, eq=False)
class _Equation:
    """An equation along the motions to which it was fitted, and along those of held-out records."""

    along: AlongMotion
    fit: FitResult
    values: Mapping[str, float]
    motions: tuple[tuple[EffectTerms, Regression], ...]

    @classmethod
    def along_records(cls, along: AlongMotion, fit: FitResult, terms: Sequence[EffectTerms]) -> _Equation:
        values = {**along.terms_of.values, **fit.all_values}
        return cls(along, fit, values, tuple((own, Regression(own.fit, values)) for own in terms))

    def laws_at(self, joint: Joint, argument: str) -> tuple[str, ...]:
        """Return the names of the terms at a joint that are functions of an argument alone."""
        found = []
        for effect in self.fit.structure.effects:
            own = {sp.Symbol(p.name, real=True) for p in effect.parameters}
            read = set().union(*(e.free_symbols for e in effect.equations.values())) - own
            is_law = effect.place is Place.DYNAMICS and not effect.states and read <= {*_SIGNALS[argument]}
            if is_law and self.along.is_at(effect, joint):
                found.append(effect.name)
        return tuple(found)

    def rows(self, left_out: Sequence[str], joint: Joint, argument: str) -> tuple[_Rows, _Rows]:
        """Return the rows of the fitted motions and of the held-out ones, without some terms of the equation."""
        symbol, size = _SIGNALS[argument][0], self.along.size(_DIMENSIONS[argument], joint)
        laws = [compiled(canonical.sigmoid(symbol, knot * size, side), (symbol,)) for knot, side in _OFFERED]
        seen, held = (self._rows(*own, left_out, joint, argument, laws) for own in self.motions)
        return seen, held

    def _rows(
        self, terms_of: EffectTerms, regression: Regression, left_out: Sequence[str], joint: Joint, argument: str,
        laws: Sequence[Callable[[Floats], Floats]],
    ) -> _Rows:  # fmt: skip
        columns = []
        for motion in terms_of.fit.motions:
            moved, unit = joint_motion(motion, joint, self.values), per_force(motion, joint, self.values)
            signal = moved.x if argument == "displacement" else moved.directed
            columns.append(motion.thinned(np.array([unit * law(signal) for law in laws])))
        kept = [term.columns for term in self.along.of_equation(self.fit, left_out, terms_of)]
        wider = regression.with_columns([*kept, columns], [False] * (len(kept) + 1))
        matrix = wider.matrix * wider.size
        n = matrix.shape[1] - 1 - len(laws)
        return _Rows(matrix[:, :n], matrix[:, n:-1], matrix[:, -1])

    def cost(self, seen: _Rows, held: _Rows, chosen: Sequence[int] = ()) -> float:
        """Return the information criterion of the held-out rows, with numbers fitted to the others."""
        n_numbers, independent = seen.beside.shape[1] + len(chosen), self.motions[1][1].n_rows / WIDER
        return information_criterion(held.left(chosen, seen.fitted(chosen)), n_numbers, independent)

    def shape(
        self, joint: Joint, argument: str, there: tuple[str, ...], chosen: tuple[int, ...], seen: _Rows, held: _Rows
    ) -> Shape:  # fmt: skip
        numbers, size = seen.fitted(chosen), self.along.size("force", joint)
        return Shape(
            joint=joint,
            argument=argument,
            size=self.along.size(_DIMENSIONS[argument], joint),
            in_place_of=there,
            sigmoids=chosen,
            forces=tuple(float(force / size) for force in numbers[-len(chosen) :]),
            share=1.0 - held.left(chosen, numbers) / held.left((), seen.fitted(())),
        )


def started(parameter: Parameter, number: float) -> Parameter:
    """Return a parameter whose fits start at a number, in characteristic units, and search from zero to beyond it."""
    start = _short(number)
    low, high = sorted((0.0, _short(_FURTHEST * start)))
    return replace(parameter, starts=(start,), search=(low, high))


def _short(number: float) -> float:
    return float(f"{number:.{_DIGITS}g}")
