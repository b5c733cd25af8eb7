"""Is there a hidden force with memory, and which equation does it obey?

Two looks at the same question. First the loop: the states of a Bouc-Wen element or of Iwan's sliders follow from the measured
motion alone, so either is one column of the library, with the shape of the loop found by variable projection. Then the force:
what the drive leaves after inertia, damping and the spring without memory is the hysteretic force F itself, and its own
equation ``F' = a_1 x' - a_2 |x'| |F|^(n-1) F - a_3 x' |F|^n`` is regressed like any other; that says which of its terms
the records show. Two derivatives of a noisy displacement make the second look blind long before the first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rigsight.discover.motion import Motion
from rigsight.discover.regression import Projected, inclusion_probabilities
from rigsight.discover.weak_form import Rows
from rigsight.effects import effect_named
from rigsight.rigs import RIGS
from rigsight.simulate import Structure, compose, simulate_sets
from rigsight.simulate.input_hold import hold_motion

LOOP = "bouc_wen_hysteresis"
"""The hysteresis whose force has an equation of its own."""
FORCE_TERMS = ("x'", "|x'| |F|^(n-1) F", "x' |F|^n", "F", "x")
"""Terms offered to the equation of the hysteretic force; the last two are a force that relaxes and one without memory."""
_SATURATIONS = np.geomspace(0.3, 100.0, 7)
_SKEWS = np.geomspace(0.3, 300.0, 6)
_EXPONENTS = (1.0, 1.5, 2.0)
_REACHES = np.geomspace(0.1, 30.0, 9)
_POWERS = (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6)
_SUBSTEPS = 2
_RUNAWAY = 1e6
"""Loop in units of the displacement beyond which its shape is unstable, and no column."""
_REFINEMENTS = 40
_STEP = 1e-3
"""In the logarithm: it moves the column by more than the integrator's error."""


Point = tuple[float, ...]
"""Coordinates of a loop's shape: two that are refined, then those that stay as the grid has them."""


@dataclass(frozen=True)
class LoopShape:
    """How the shape of one kind of loop is searched for.

    Attributes
    ----------
    grid
        Points to look at first.
    lowest, highest
        Bounds of the two refined coordinates.
    values
        Inner parameters of the effect at a point, for a displacement of a given size.
    """

    grid: tuple[Point, ...]
    lowest: tuple[float, float]
    highest: tuple[float, float]
    values: Callable[[Point, float], dict[str, float]]


def _bouc_wen_values(point: Point, x_size: float) -> dict[str, float]:
    """Return beta, gamma, n of (log sum, log difference, n) in units of the displacement."""
    n = point[2]
    total, difference = np.exp(point[0]) ** n / x_size**n, np.exp(point[1]) ** n / x_size**n
    return {"beta": (total + difference) / 2.0, "gamma": (total - difference) / 2.0, "n": n}


def _iwan_values(point: Point, x_size: float) -> dict[str, float]:
    """Return x_s, q of (log reach in units of the displacement, q)."""
    return {"x_s": float(np.exp(point[0])) * x_size, "q": point[1]}


LOOPS: Mapping[str, LoopShape] = {
    LOOP: LoopShape(
        tuple((np.log(s), np.log(d), n) for n in _EXPONENTS for s in _SATURATIONS for d in _SKEWS),
        (np.log(_SATURATIONS[0] / 3), np.log(_SKEWS[0] / 3)),
        (np.log(1e3), np.log(2e3)),
        _bouc_wen_values,
    ),
    "iwan_hysteresis": LoopShape(
        tuple((np.log(reach), power) for reach in _REACHES for power in _POWERS),
        (np.log(_REACHES[0] / 3), -2.0),
        (np.log(3 * _REACHES[-1]), 2.0),
        _iwan_values,
    ),
}
"""The effects that put a loop in the place of the spring, which share ``a`` of the stiffness has no part in."""


@dataclass(frozen=True)
class Loop:
    """The shape of a loop and its column.

    Attributes
    ----------
    values
        Inner parameters of the effect: beta, gamma, n of Bouc-Wen; x_s, q of Iwan.
    column
        Rows of the loop's own deflection (z, or the mean of the sliders') of all records, shape (n_rows,).
    share
        Share of what the rig's own terms leave that the loop explains.
    """

    values: Mapping[str, float]
    column: NDArray[np.float64]
    share: float


def loop_structure(effect: str = LOOP) -> Structure:
    """Return the element whose force is the loop itself: a spring of stiffness 1, all of it with memory."""
    return compose(RIGS["element"], [effect_named(effect)])


def best_loop(
    effect: str, motions: Sequence[Motion], rows: Rows, projected: Projected, x_size: float, driven: bool
) -> Loop | None:
    """Return the loop that explains most of what the rig's own terms leave, None where none explains anything.

    Parameters
    ----------
    effect
        Kind of loop, one of `LOOPS`.
    motions
        Of all records.
    rows
        How signals become rows.
    projected
        The rig's own terms (its spring among them: it takes the part without memory).
    x_size
        Size of the displacement.
    driven
        True if the acceleration is regressed, false if the force is.
    """
    shape = LOOPS[effect]
    structure = loop_structure(effect)

    def columns_at(points: Sequence[Point]) -> NDArray[np.float64]:
        return _columns(structure, motions, rows, [shape.values(p, x_size) for p in points], x_size)

    sign = -1.0 if driven else 1.0
    columns = sign * columns_at(shape.grid)
    shares = [_share(projected, columns[:, i]) for i in range(len(shape.grid))]
    first = int(np.argmax(shares))
    if shares[first] <= 0.0:
        return None
    kept = shape.grid[first][2:]

    rest = projected.rest_of(projected.target)

    def left(column: NDArray[np.float64]) -> NDArray[np.float64]:
        if not np.all(np.isfinite(column)):
            return rest
        column = projected.rest_of(column)
        return np.asarray(rest - column * (column @ rest) / max(float(column @ column), 1e-300))

    seen: dict[bytes, NDArray[np.float64]] = {}

    def around(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is left at a point and at a step along each axis: three loops cost as much as one."""
        key = theta.tobytes()
        if key not in seen:
            seen.clear()
            points = [
                (*theta, *kept),
                (theta[0] + _STEP, theta[1], *kept),
                (theta[0], theta[1] + _STEP, *kept),
            ]
            near = columns_at(points)
            seen[key] = np.column_stack([left(near[:, i]) for i in range(len(points))])
        return seen[key]

    start = np.array(shape.grid[first][:2])

    def here(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(around(theta)[:, 0])

    def slopes(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        near = around(theta)
        return np.asarray((near[:, 1:] - near[:, :1]) / _STEP)

    solution = least_squares(
        here, start, jac=slopes, bounds=(shape.lowest, shape.highest), ftol=1e-6, max_nfev=_REFINEMENTS
    )
    point = (*map(float, solution.x), *kept)
    column = sign * columns_at([point])[:, 0]
    return Loop(shape.values(point, x_size), column, _share(projected, column))


def _share(projected: Projected, column: NDArray[np.float64]) -> float:
    """Return what a loop explains; a loop that would have to push instead of resist explains nothing."""
    if not np.all(np.isfinite(column)):
        return 0.0
    weights, share = projected.explained(column[:, None])
    return share if weights[0] > 0.0 else 0.0


def _columns(
    structure: Structure,
    motions: Sequence[Motion],
    rows: Rows,
    shapes: Sequence[Mapping[str, float]],
    x_size: float,
) -> NDArray[np.float64]:
    """Return the rows of several loops' deflections, shape (n_rows, n_loops)."""
    fixed = {"d": 0.0, "k": 1.0, "force_off": 0.0, "A": 1.0, "a": 0.0}
    values = [{**fixed, **inner} for inner in shapes]
    p = np.array([[v[name] for v in values] for name in structure.names])
    blocks = []
    for motion in motions:
        held = hold_motion(motion.x, motion.v, motion.dt)
        start = np.zeros((len(structure.states), len(shapes)))
        with np.errstate(all="ignore"):
            z = simulate_sets(structure, held, p, start, motion.x.size, _SUBSTEPS)[:, 0, :]
            z = np.where(np.abs(z) < _RUNAWAY * x_size, z, np.nan)
        blocks.append(np.column_stack([rows.of(np.ascontiguousarray(z[:, i])) for i in range(len(shapes))]))
    return np.concatenate(blocks)


@dataclass(frozen=True)
class ForceEquation:
    """The regressed equation of the hysteretic force.

    Attributes
    ----------
    coefficients, inclusion
        By term of `FORCE_TERMS` [SI].
    n
        The exponent taken.
    share
        Share of the force's rate that the equation explains.
    """

    coefficients: Mapping[str, float]
    inclusion: Mapping[str, float]
    n: float
    share: float


def force_equation(
    motions: Sequence[Motion],
    rows: Rows,
    forces: Sequence[NDArray[np.float64]],
    n: float,
    rng: np.random.Generator,
) -> ForceEquation:
    """Regress the equation of the hysteretic force.

    Parameters
    ----------
    motions
        Of all records.
    rows
        How signals become rows.
    forces
        Per record the hysteretic force, shape (n_samples,).
    n
        Exponent.
    rng
        Source of the ensemble.
    """
    target, columns = [], []
    for motion, force in zip(motions, forces, strict=True):
        power = np.abs(force) ** n
        signals = (
            motion.v,
            -np.abs(motion.v) * power * np.sign(force),
            -motion.v * power,
            -force,
            motion.x,
        )
        target.append(rows.rate_of(force, motion.dt))
        columns.append(np.column_stack([rows.of(signal) for signal in signals]))
    matrix = np.concatenate(columns)
    rate = np.concatenate(target)
    # Nothing is projected out but a constant rate, which no force can have for long.
    projected = Projected(np.ones((rate.size, 1)), rate, rate.size * rows.independent_share(1))
    inclusion = inclusion_probabilities(projected, matrix, rng)
    taken = inclusion >= 0.5
    coefficients = np.zeros(len(FORCE_TERMS))
    share = 0.0
    if np.any(taken):
        coefficients[taken], share = projected.explained(matrix[:, taken])
    return ForceEquation(
        dict(zip(FORCE_TERMS, map(float, coefficients), strict=True)),
        dict(zip(FORCE_TERMS, map(float, inclusion), strict=True)),
        n,
        share,
    )
