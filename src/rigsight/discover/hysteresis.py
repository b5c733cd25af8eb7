"""Hidden forces with memory: the states of a loop follow from the measured motion, so the loop can be a regression column.

Any effect that replaces the deflection of the spring by states is such a loop. Its nonlinear parameters are taken from its
declaration and estimated by variable projection: a grid over them, linear regression for the rest, and a descent from the best
points.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from scipy.optimize import least_squares

from rigsight.discover.regression import Projected, Regressed
from rigsight.effects import Effect, SumAndDifference
from rigsight.effects import symbols as canonical
from rigsight.parameters import Parameter
from rigsight.records.record import Floats
from rigsight.rigs import RIGS
from rigsight.simulate import Structure, compose, simulate_sets
from rigsight.simulate.input_hold import hold_motion
from rigsight.units import characteristic_value

_POINTS = 7
"""Points of the grid along each coordinate; over decades, neighboring sizes differ by less than a factor of three."""
_LEAST_SIZE = 0.1
_WITHIN = (3.0, 0.1)
"""Factors on the ends of the range of a size at which the grid begins and ends: at the very ends a loop is only a spring, or
vanishes."""
_OF_POWERS = 0.5
"""Share of its range that the grid of a power spans, about its middle."""
_TIMES_SPECIAL = (1.0, 1.5, 2.0)
"""Multiples of a special value at which such a parameter is tried; it keeps the best of them."""
_SUBSTEPS = 2
_RUNAWAY = 1e6
"""Size of the loop in units of the displacement above which its shape is unstable and the column is not used."""
_STARTS = 3
_REFINEMENTS = 40
_STEP = 1e-3
"""Step of a difference quotient in the logarithm, or in a power: it changes the column by more than the integrator's error."""

Point = tuple[float, ...]
"""Coordinates of a loop's shape: those that are refined, then those that keep their grid values."""


def is_loop(effect: Effect) -> bool:
    """Return True for a spring with a part whose memory depends on the deflection alone."""
    known = {canonical.deflection, canonical.deflection_rate}
    known |= {sp.Symbol(p.name, real=True) for p in effect.parameters} | {s.symbol for s in effect.states}
    return (
        effect.spring is not None
        and effect.post_yield_stiffness_ratio is not None
        and bool(effect.states)
        and all(state.rate.free_symbols <= known for state in effect.states)
    )


@dataclass(frozen=True)
class LoopShape:
    """The coordinates in which the shape of a loop is searched for, as its effect declares them.

    Sum and difference of a pair, and parameters that are searched logarithmically, are sizes: the coordinate is their logarithm.
    Of the other parameters, those with a special value keep the values of the grid.
    """

    pairs: tuple[SumAndDifference, ...]  # parameters that are varied as sum and difference
    single: tuple[Parameter, ...]  # parameters that are varied alone
    # Parameters that keep the values of the grid, with their special values.
    kept: tuple[tuple[str, float], ...]
    dimensions: Mapping[str, str]  # dimension text of each parameter

    @classmethod
    def of(cls, effect: Effect) -> LoopShape:
        """Take the coordinates from the declaration of an effect."""
        paired = {name for pair in effect.searched_as for name in (pair.first, pair.second)}
        inside = [
            p
            for p in effect.parameters
            if p.fitted and p.name not in {effect.post_yield_stiffness_ratio, *paired}
        ]
        return cls(
            pairs=effect.searched_as,
            single=tuple(p for p in inside if p.name not in effect.special_cases),
            kept=tuple(
                (p.name, effect.special_cases[p.name]) for p in inside if p.name in effect.special_cases
            ),
            dimensions={p.name: p.dimension for p in effect.parameters},
        )

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lowest and highest value of each refined coordinate."""
        sizes = [r for pair in self.pairs for r in (pair.sum_range, pair.difference_range)]
        ranges = [_logarithms(r) for r in sizes]
        ranges += [_logarithms(p.search) if p.logarithmic else p.search for p in self.single]
        low, high = np.array(ranges).T
        return low, high

    @property
    def grid(self) -> list[Point]:
        """Points that are tried first."""
        sized = [True] * (2 * len(self.pairs)) + [p.logarithmic for p in self.single]
        axes: list[Sequence[float]] = []
        for low, high, is_size in zip(*self.bounds, sized, strict=True):
            if is_size:
                first, last = (edge + float(np.log(f)) for edge, f in zip((low, high), _WITHIN, strict=True))
            else:
                half = _OF_POWERS * (high - low) / 2.0
                first, last = (low + high) / 2.0 - half, (low + high) / 2.0 + half
            axes.append([float(value) for value in np.linspace(first, last, _POINTS)])
        axes += [[times * special for times in _TIMES_SPECIAL] for _, special in self.kept]
        return list(itertools.product(*axes))

    def values(self, point: Point, scales: Mapping[str, float]) -> dict[str, float]:
        """Return the nonlinear parameters at a point, whose sizes are in units of the characteristic scales."""
        first_kept = 2 * len(self.pairs) + len(self.single)
        found = dict(zip((name for name, _ in self.kept), point[first_kept:], strict=True))
        for index, pair in enumerate(self.pairs):
            power = 1.0 if pair.exponent is None else found[pair.exponent]
            unit = characteristic_value(self.dimensions[pair.first], scales)
            total, difference = (float(np.exp(c) * unit) ** power for c in point[2 * index : 2 * index + 2])
            found[pair.first], found[pair.second] = (total + difference) / 2.0, (total - difference) / 2.0
        for parameter, coordinate in zip(self.single, point[2 * len(self.pairs) : first_kept], strict=True):
            size = float(np.exp(coordinate)) if parameter.logarithmic else coordinate
            found[parameter.name] = size * characteristic_value(parameter.dimension, scales)
        return found


def _logarithms(limits: tuple[float, float]) -> tuple[float, float]:
    return float(np.log(max(limits[0], _LEAST_SIZE))), float(np.log(limits[1]))


@dataclass(frozen=True)
class Loop:
    """The shape of a loop and its column."""

    values: Mapping[str, float]  # nonlinear parameters of the effect
    column: Floats  # rows of the loop's own deflection in all records, shape (n_rows,)
    share: float  # share of the residual of the rig's own terms that the loop explains


def loop_structure(effect: Effect) -> Structure:
    """Return the element whose force is the loop itself: a spring of stiffness 1, all of it with memory."""
    return compose(RIGS["element"], [effect])


def best_loop(effect: Effect, regressed: Regressed) -> Loop | None:
    """Return the loop that explains most of the residual of the rig's own terms; None if none explains any of it."""
    shape, structure, projected = LoopShape.of(effect), loop_structure(effect), regressed.projected
    grid, bounds = shape.grid, shape.bounds
    n_refined = bounds[0].size

    def columns_at(points: Sequence[Point]) -> Floats:
        shapes = [shape.values(point, regressed.scales) for point in points]
        return _columns(structure, effect, regressed, shapes)

    sign = -1.0 if regressed.driven else 1.0
    columns = sign * columns_at(grid)
    shares = [_share(projected, columns[:, i]) for i in range(len(grid))]
    starts = _apart(grid, shares)
    if not starts:
        return None

    rest = projected.rest

    def remainder(column: Floats) -> Floats:
        if not np.all(np.isfinite(column)):
            return rest
        column = projected.rest_of(column)
        return np.asarray(rest - column * (column @ rest) / max(float(column @ column), 1e-300))

    def refined(start: Point) -> Loop:
        kept = start[n_refined:]
        seen: dict[bytes, Floats] = {}

        def around(theta: Floats) -> Floats:
            """Return the residual at a point and one step along each axis; a few loops at once cost as much as one."""
            key = theta.tobytes()
            if key not in seen:
                seen.clear()
                steps = np.vstack([np.zeros(n_refined), _STEP * np.eye(n_refined)])
                points = [(*map(float, theta + step), *kept) for step in steps]
                near = columns_at(points)
                seen[key] = np.column_stack([remainder(near[:, i]) for i in range(len(points))])
            return seen[key]

        def here(theta: Floats) -> Floats:
            return np.asarray(around(theta)[:, 0])

        def slopes(theta: Floats) -> Floats:
            near = around(theta)
            return np.asarray((near[:, 1:] - near[:, :1]) / _STEP)

        first = np.array(start[:n_refined])
        solution = least_squares(here, first, jac=slopes, bounds=bounds, ftol=1e-6, max_nfev=_REFINEMENTS)
        point = (*map(float, solution.x), *kept)
        column = sign * columns_at([point])[:, 0]
        return Loop(shape.values(point, regressed.scales), column, _share(projected, column))

    return max(map(refined, starts), key=lambda loop: loop.share)


def _apart(grid: Sequence[Point], shares: Sequence[float]) -> list[Point]:
    """Return the best points of a grid, each with another size, because a slider may be mistaken for its neighbor."""
    found: list[Point] = []
    for index in np.argsort(shares)[::-1]:
        point = grid[int(index)]
        if shares[index] > 0.0 and all(point[0] != other[0] for other in found):
            found.append(point)
    return found[:_STARTS]


def _share(projected: Projected, column: Floats) -> float:
    """Return the share that a loop explains; 0 for a loop that would have to drive the motion instead of resisting it."""
    if not np.all(np.isfinite(column)):
        return 0.0
    weights, share = projected.explained(column[:, None])
    return share if weights[0] > 0.0 else 0.0


def _columns(
    structure: Structure, effect: Effect, regressed: Regressed, shapes: Sequence[Mapping[str, float]]
) -> Floats:
    """Return the rows of several loops' deflections, shape (n_rows, n_loops)."""
    motion_of_element = structure.rig.motion
    fixed = {p.name: 0.0 for p in structure.rig.parameters} | {motion_of_element.stiffness.name: 1.0}
    fixed |= {p.name: p.default for p in effect.parameters if p.default is not None}
    assert effect.post_yield_stiffness_ratio is not None
    values = [{**fixed, effect.post_yield_stiffness_ratio: 0.0, **inner} for inner in shapes]
    p = np.array([[v[name] for v in values] for name in structure.names])

    def block(index: int) -> Floats:
        motion = regressed.motions[index]
        held = hold_motion(motion.x, motion.v, motion.dt)
        start = np.zeros((len(structure.states), len(shapes)))
        with np.errstate(all="ignore"):
            z = simulate_sets(structure, held, p, start, motion.x.size, _SUBSTEPS)[:, 0, :]
            z = np.where(np.abs(z) < _RUNAWAY * regressed.scales["x"], z, np.nan)
        return np.column_stack(
            [regressed.rows.of(np.ascontiguousarray(z[:, i]), motion.dt) for i in range(len(shapes))]
        )

    return np.concatenate(regressed.threads.results(block, [m.x.size for m in regressed.motions]))
