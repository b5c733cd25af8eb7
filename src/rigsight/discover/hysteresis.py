"""Is there a hidden force with memory, and which equation does it obey?

Two looks at the same question. First the loop: the state z of a Bouc-Wen element follows from the measured motion alone, so it
is one column of the library, with the shape of the loop found by variable projection. Then the force: what the drive leaves
after inertia, damping and the spring without memory is the hysteretic force F itself, and its own equation
``F' = a_1 x' - a_2 |x'| |F|^(n-1) F - a_3 x' |F|^n`` is regressed like any other; that says which of its terms the records
show. Two derivatives of a noisy displacement make the second look blind long before the first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
FORCE_TERMS = ("x'", "|x'| |F|^(n-1) F", "x' |F|^n", "F", "x")
"""Terms offered to the equation of the hysteretic force; the last two are a force that relaxes and one without memory."""
_SATURATIONS = np.geomspace(0.3, 100.0, 7)
_SKEWS = np.geomspace(0.3, 300.0, 6)
_EXPONENTS = (1.0, 1.5, 2.0)
_SUBSTEPS = 2
_RUNAWAY = 1e6
"""Loop in units of the displacement beyond which its shape is unstable, and no column."""
_REFINEMENTS = 40
_STEP = 1e-3
"""In the logarithm: it moves the column by more than the integrator's error."""


@dataclass(frozen=True)
class Loop:
    """The shape of a Bouc-Wen loop and its column.

    Attributes
    ----------
    values
        beta, gamma, n.
    column
        Rows of z of all records, shape (n_rows,).
    share
        Share of what the rig's own terms leave that the loop explains.
    """

    values: Mapping[str, float]
    column: NDArray[np.float64]
    share: float


def loop_structure() -> Structure:
    """Return the element whose force is z itself: a spring of stiffness 1, all of it with memory."""
    return compose(RIGS["element"], [effect_named(LOOP)])


def best_loop(
    motions: Sequence[Motion], rows: Rows, projected: Projected, x_size: float, driven: bool
) -> Loop | None:
    """Return the loop that explains most of what the rig's own terms leave, None where none explains anything.

    Parameters
    ----------
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
    grid = [
        (np.log(saturation), np.log(skew), n)
        for n in _EXPONENTS
        for saturation in _SATURATIONS
        for skew in _SKEWS
    ]
    sign = -1.0 if driven else 1.0
    columns = sign * _columns(motions, rows, grid, x_size)
    shares = [_share(projected, columns[:, i]) for i in range(len(grid))]
    first = int(np.argmax(shares))
    if shares[first] <= 0.0:
        return None
    n = grid[first][2]

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
                (theta[0], theta[1], n),
                (theta[0] + _STEP, theta[1], n),
                (theta[0], theta[1] + _STEP, n),
            ]
            near = _columns(motions, rows, points, x_size)
            seen[key] = np.column_stack([left(near[:, i]) for i in range(len(points))])
        return seen[key]

    bounds = ([np.log(_SATURATIONS[0] / 3), np.log(_SKEWS[0] / 3)], [np.log(1e3), np.log(2e3)])
    start = np.array(grid[first][:2])

    def here(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(around(theta)[:, 0])

    def slopes(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        near = around(theta)
        return np.asarray((near[:, 1:] - near[:, :1]) / _STEP)

    solution = least_squares(here, start, jac=slopes, bounds=bounds, ftol=1e-6, max_nfev=_REFINEMENTS)
    theta = (float(solution.x[0]), float(solution.x[1]), n)
    column = sign * _columns(motions, rows, [theta], x_size)[:, 0]
    return Loop(_values(theta, x_size), column, _share(projected, column))


def _share(projected: Projected, column: NDArray[np.float64]) -> float:
    """Return what a loop explains; a loop that would have to push instead of resist explains nothing."""
    if not np.all(np.isfinite(column)):
        return 0.0
    weights, share = projected.explained(column[:, None])
    return share if weights[0] > 0.0 else 0.0


def _values(theta: tuple[float, float, float], x_size: float) -> dict[str, float]:
    """Return beta, gamma, n of (log sum, log difference) in units of the displacement."""
    n = theta[2]
    total, difference = np.exp(theta[0]) ** n / x_size**n, np.exp(theta[1]) ** n / x_size**n
    return {"beta": (total + difference) / 2.0, "gamma": (total - difference) / 2.0, "n": n}


def _columns(
    motions: Sequence[Motion], rows: Rows, thetas: Sequence[tuple[float, float, float]], x_size: float
) -> NDArray[np.float64]:
    """Return the rows of z for several loops, shape (n_rows, n_loops)."""
    structure = loop_structure()
    fixed = {"d": 0.0, "k": 1.0, "force_off": 0.0, "A": 1.0, "a": 0.0}
    values = [{**fixed, **_values(theta, x_size)} for theta in thetas]
    p = np.array([[v[name] for v in values] for name in structure.names])
    blocks = []
    for motion in motions:
        held = hold_motion(motion.x, motion.v, motion.dt)
        start = np.zeros((1, len(thetas)))
        with np.errstate(all="ignore"):
            z = simulate_sets(structure, held, p, start, motion.x.size, _SUBSTEPS)[:, 0, :]
            z = np.where(np.abs(z) < _RUNAWAY * x_size, z, np.nan)
        blocks.append(np.column_stack([rows.of(np.ascontiguousarray(z[:, i])) for i in range(len(thetas))]))
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
