"""Information of fitted records on each parameter and their combinations, and the bounds that they ask parameters to pass."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import orth
from scipy.stats import norm

from rigsight.identify.fit.covariance import LEVEL
from rigsight.identify.fit.derivatives import central_sensitivities, place_of_fit
from rigsight.identify.fit.fit_data import FitResult
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.records.record import Floats
from rigsight.units import behind, characteristic_value, matters_at

_LARGEST_POWER = 3
ONE = 0.03
"""Relative distance up to which a factor between values of the same unit counts as one (and is left out), and a power as a small
fraction."""


POORLY_KNOWN = 0.5
"""Relative standard error from which a parameter is not determined: its 95 % interval reaches zero, or twice the value."""
TAKES_PART = 0.05
"""Share of the largest change, or influence, from which a parameter is a member of a direction."""
ROUNDING = 1e-9
"""Entry of a unit direction below which it is rounding error."""
_OWN_SIZE = 0.5
"""Value over its characteristic size from which a parameter of either sign is its own reference, as a stiffness that gives the
records their size."""
_FOLLOWED = 1e-10
"""Share of the largest influence of initial states below which a combination of them has none."""
_STOPPED = 0.1
"""Distance to the bound over the step that is asked for: a search that could still move would not stop before most of it."""


def marginal_errors(root: Floats) -> Floats:
    """Return the standard error of each coordinate, infinite if it has a component in an undetermined direction."""
    sizes, right = _directions(root)
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = np.where(np.abs(right) > ROUNDING, np.abs(right) / sizes[:, None], 0.0)
    return np.asarray(np.sqrt(np.sum(parts**2, axis=0)))


def conditional_errors(root: Floats) -> Floats:
    """Return the standard error of each coordinate if all others were known."""
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / np.linalg.norm(root, axis=0))


def undetermined(root: Floats) -> Floats:
    """Return an orthonormal basis of the directions with a larger standard error than a poorly known parameter."""
    sizes, right = _directions(root)
    return np.asarray(right[sizes * POORLY_KNOWN < 1.0].T)


def _directions(root: Floats) -> tuple[Floats, Floats]:
    """Return the singular value of each direction of the coordinates, zero included, and the directions as rows."""
    _, singular, right = np.linalg.svd(root, full_matrices=True)
    return np.pad(singular, (0, root.shape[1] - singular.size)), right


def sparsest(free: Floats, influence: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Return the direction with the fewest members among those of a reduced row echelon form, and the members' indices."""
    # A member has a large relative change itself, or a large influence on the outputs.
    rows = (free * influence[:, None]).T
    for place in range(rows.shape[0]):
        pivot = np.unravel_index(np.argmax(np.abs(rows[place:])), rows[place:].shape)
        row, column = place + int(pivot[0]), int(pivot[1])
        rows[[place, row]] = rows[[row, place]]
        rows[place] /= rows[place, column]
        others = np.arange(rows.shape[0]) != place
        rows[others] -= np.outer(rows[others, column], rows[place])
    directions = rows / influence
    members = [
        np.flatnonzero(
            (np.abs(row) >= TAKES_PART * np.max(np.abs(row)))
            | (np.abs(direction) >= TAKES_PART * np.max(np.abs(direction)))
        )
        for row, direction in zip(rows, directions, strict=True)
    ]
    best = min(range(len(members)), key=lambda i: members[i].size)
    return directions[best], members[best]


def product_text(factors: Sequence[tuple[str, int]]) -> str:
    """Return a product of powers, as in ``k*m^2/d``."""
    above = [_power(text, power) for text, power in factors if power > 0]
    below = [_power(text, -power) for text, power in factors if power < 0]
    return "*".join(above) + "".join(f"/{text}" for text in below)


def sum_text(first: str, weight: float, second: str, same_unit: bool) -> str:
    """Return ``first + weight second``; the weight is left out if it is one and both have the same unit."""
    factor = "" if same_unit and abs(abs(weight) - 1.0) < ONE else f"{abs(weight):.3g} "
    return f"{first} {'-' if weight < 0.0 else '+'} {factor}{second}"


def small_fraction(ratio: float) -> Fraction | None:
    """Return the fraction of small integers to which a ratio is close, None if there is none; a step along it then decides."""
    nearest = Fraction(ratio).limit_denominator(_LARGEST_POWER)
    close = nearest != 0 and abs(float(nearest) - ratio) <= ONE * abs(ratio)
    return nearest if close and abs(nearest.numerator) <= _LARGEST_POWER else None


def listed(names: Sequence[str]) -> str:
    """Return names as in ``a, b and c``."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def percent(error: float) -> str:
    """Return a relative error in percent, or as a multiple of the value from 100 % on."""
    return f"{100.0 * error:.2g} %" if error < 0.995 else f"{error:.2g} times its value"


def _power(text: str, power: int) -> str:
    whole = f"({text})" if any(sign in text for sign in " */") else text
    return whole if power == 1 else f"{whole}^{power}"


@dataclass(frozen=True, eq=False)
class Information:
    """Response of the outputs to relative changes of parameters, with the initial states projected out."""

    # Of the fitted parameters.
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Floats  # their values, shape (n,)
    # Reference of the relative changes, shape (n,): the value, or the size in the records for a parameter
    # that may be zero: one of either sign, and one that cannot be distinguished from its bound zero.
    sizes: Floats
    # Their bounds, shape (n,).
    lower: Floats
    upper: Floats
    # The values after one step to the minimum without bounds, shape (n,); at a minimum inside the bounds `values`.
    asked: Floats
    root: Floats  # ``root.T @ root`` is the information matrix in units of the noise, shape (m, n)
    # Length of the change of all outputs, in units of the noise, when parameters take other values.
    change: Callable[[Mapping[str, float]], float]


def information(fit: GreyBoxFit, result: FitResult) -> Information:
    """Return the information of the records of a fit on its parameters."""
    parameters = [p for p in fit.structure.parameters if p.name in result.free]
    values = np.array([result.values[p.name] for p in parameters])
    scales = np.array(
        [
            fit.scales.get(matters_at(p.name), abs(characteristic_value(p.dimension, fit.scales)))
            for p in parameters
        ]
    )
    names = tuple(p.name for p in parameters)
    model = _Model(fit, result, names)
    noise = np.sqrt(result.cost / max(result.n_samples - len(names), 1)) or 1.0
    # The relative error of a parameter that may have either sign (an offset) would depend on its value.
    either_sign = np.array([p.lower < 0.0 for p in parameters]) & (np.abs(values) < _OWN_SIZE * scales)
    # So would that of a parameter at its bound of zero, as a damping that is none.
    least = noise * conditional_errors(np.vstack(model.rows)) / POORLY_KNOWN
    known = [np.isfinite(result.standard_errors[name]) for name in names]
    at_zero = np.array([p.lower == 0.0 and not p.logarithmic for p in parameters]) & known & (values < least)
    sizes = np.where(either_sign | (at_zero & (values < scales)) | (values == 0.0), scales, values)
    root = np.vstack([_triangle(rows) for rows in model.rows]) * sizes / noise
    return Information(
        names=names,
        units=tuple(p.unit for p in parameters),
        values=values,
        sizes=sizes,
        lower=np.array([p.lower for p in parameters]),
        upper=np.array([p.upper for p in parameters]),
        asked=model.minimum(),
        root=_triangle(root) / _coloring(root, result, names, sizes),
        change=lambda moved: model.change({**result.values, **moved}) / noise,
    )


def answers_to_states(fit: GreyBoxFit, result: FitResult) -> list[Floats]:
    """Return the derivatives of each record's weighted readings by its initial states and free offsets, at the end of a fit.

    Shape (n_readings, n_states + n_offsets) each, per unit of a coordinate of the search.
    """
    return [answers for _, answers in central_sensitivities(*place_of_fit(fit, result, result.values, ()))]


class _Model:
    """Outputs of a fitted model as functions of its parameters, with the initial states projected out."""

    def __init__(self, fit: GreyBoxFit, result: FitResult, names: Sequence[str]) -> None:
        self._fit, self._result = fit, result
        problem, theta = place_of_fit(fit, result, result.values, names)
        n, slopes = len(names), problem.coordinates.jacobian(theta[: len(names)])
        # The start of a search keeps a distance from bounds, so that this is not quite the end of the fit.
        self._place = problem.coordinates.to_parameters(theta[:n])[problem.coordinates.index]
        self._residuals, self._followed, self.rows = [], [], []
        for residual, derivative in central_sensitivities(problem, theta):
            states = derivative[:, n:]
            length = np.linalg.norm(states, axis=0)
            basis = orth(states[:, length > 0.0] / length[length > 0.0], rcond=_FOLLOWED)
            own = np.linalg.solve(slopes.T, derivative[:, :n].T).T
            self._residuals.append(residual)
            self._followed.append(basis)
            self.rows.append(own - basis @ (basis.T @ own))

    def minimum(self) -> Floats:
        """Return the parameters at the minimum of the linearized fit without bounds, in their units, shape (n,)."""
        rows, remainder = np.vstack(self.rows), np.concatenate(self._residuals)
        size = np.linalg.norm(rows, axis=0)
        size[size == 0.0] = 1.0
        return np.asarray(self._place - np.linalg.lstsq(rows / size, remainder, rcond=_FOLLOWED)[0] / size)

    def change(self, values: Mapping[str, float]) -> float:
        """Return the length of the change of all weighted outputs when parameters take other values."""
        problem, theta = place_of_fit(self._fit, self._result, values, ())
        total = 0.0
        for (moved, _), residual, basis in zip(
            problem.sensitivities(theta), self._residuals, self._followed, strict=True
        ):
            change = moved - residual
            total += float(np.sum((change - basis @ (basis.T @ change)) ** 2))
        return float(np.sqrt(total))


def _triangle(rows: Floats) -> Floats:
    return np.asarray(np.linalg.qr(rows, mode="r"))


def _coloring(root: Floats, result: FitResult, names: Sequence[str], sizes: Floats) -> float:
    """Return the ratio of the standard errors to those for white residuals, as the median over the parameters."""
    _, singular, right = np.linalg.svd(root, full_matrices=False)
    known = singular > 1e-6 * singular[:1]
    white = np.sqrt(np.sum((right[known] / singular[known, None]) ** 2, axis=0))
    reported = np.array([result.standard_errors[name] for name in names]) / np.abs(sizes)
    # The two are comparable only for parameters without a component in an undetermined direction.
    seen = (
        np.all(np.abs(right[~known]) < 1e-3, axis=0)
        & np.isfinite(reported)
        & (reported > 0.0)
        & (white > 0.0)
    )
    return max(float(np.median(reported[seen] / white[seen])), 1.0) if np.any(seen) else 1.0


@dataclass(frozen=True)
class ReachedBound:
    """A parameter at a bound that the records ask it to pass."""

    # The parameter.
    name: str
    unit: str
    # ``"lower"`` or ``"upper"``, and its value.
    side: str
    bound: float
    # Value that the records ask for, by one step without the bound, and its standard error; a rough value,
    # because the other parameters are those beside the bound.
    asked: float
    std: float

    @property
    def sentence(self) -> str:
        """What was found, and what it may mean."""
        unit = behind(self.unit)
        sign = f"the sign of {self.name} or of a signal is wrong, " if self.bound == 0.0 else ""
        return (
            f"{self.name} stops at its {self.side} bound of {self.bound:.3g}{unit}; the records ask for about "
            f"{self.asked:.2g} +/- {self.std:.1g}{unit}. Either {sign}the equations lack an effect or are wrong "
            f"(see 'rigsight diagnose'), or the rig file must allow such values. The other values hold only beside this bound."
        )


def reached_bounds(found: Information, standard_errors: Mapping[str, float]) -> tuple[ReachedBound, ...]:
    """Return the parameters that stand at a bound and would pass it significantly."""
    # A parameter whose interval contains the bound, such as a damping that is zero within its error, is not among them.
    width = float(norm.ppf(0.5 + 0.5 * LEVEL))
    reached = []
    for index, name in enumerate(found.names):
        value, asked, std = found.values[index], found.asked[index], standard_errors.get(name, np.inf)
        for side, bound in (("lower", found.lower[index]), ("upper", found.upper[index])):
            outward = -1.0 if side == "lower" else 1.0
            beyond = outward * (asked - bound)
            stopped = outward * (bound - value) <= _STOPPED * abs(asked - value)
            if np.isfinite(bound) and stopped and beyond > width * std:
                reached.append(ReachedBound(name, found.units[index], side, float(bound), float(asked), std))
    return tuple(reached)
