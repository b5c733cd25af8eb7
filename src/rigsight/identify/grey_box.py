"""Output-error fit of a structure's parameters, initial states included, to any number of records at once.

The residuals and their derivatives come from one call of the side-by-side integrator per record: the current parameters and
every shifted one are its lanes. The optimizer is scipy's bounded trust-region least squares, fed with an equivalent
compressed problem: it only uses J^T J, J^T r and r^T r, so a square root of J^T J stands for the tall Jacobian.

References
----------
L. Ljung, *System Identification* (Prentice Hall 1999), chapters 7 and 9, for output error and its covariance with colored
residuals. M. A. Branch, T. F. Coleman and Y. Li, SIAM J. Sci. Comput. 21 (1999) 1, for the optimizer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rigsight.errors import SimulationError
from rigsight.identify.coordinates import STEP, Coordinates
from rigsight.identify.covariance import colored_covariance, propagated_covariance
from rigsight.identify.first_states import first_state, state_at_rest
from rigsight.identify.fit_memory import FitMemory, fit_key, record_digest
from rigsight.identify.fit_result import FitResult
from rigsight.records.record import Record
from rigsight.simulate import (
    Structure,
    choose_substeps,
    record_input,
    simulate_outputs,
    simulate_sets,
    state_limits,
)
from rigsight.simulate.input_hold import HeldInput
from rigsight.units import characteristic_value

DEFAULT_ACCURACY = 1e-4
"""Relative accuracy of simulations inside a fit: below the noise of any bench."""
_MOST_SUBSTEPS = 16
"""A model that is too stiff for this many is fitted with them all the same: its residuals are recomputed accurately."""
_MOST_ROUNDS = 4
"""Fits that follow each other with finer steps."""
_WORTH_REFINING = 1e-3
"""Share of the cost that finer steps must promise to remove."""
_STATE_RANGE = 20.0
"""How far an initial state may move from its guess, in units of its size."""
_LEAST_RANGE = 1e-9
"""Least unit of a limited state, in units of its size: a play of zero has no range."""
_WORSE = 1e3
_FIRST_SUBSTEPS = 4
_FIRST_PLACES = (0.0, -1.0, -0.5, 0.5, 1.0)
"""Where limited states may stand when a record begins, as shares of their range: a descent from a wrong end stays there."""


@dataclass(frozen=True)
class _Data:
    """One record as the fit sees it."""

    record: Record
    held: HeldInput
    measured: NDArray[np.float64]
    weights: NDArray[np.float64]
    first_state: NDArray[np.float64]


class GreyBoxFit:
    """Output-error least squares of a structure on records.

    Parameters
    ----------
    structure
        Rig and effects.
    records
        Records to fit; a record may lack any output but the first.
    scales
        Size of each base quantity, see `characteristic_scales`.
    output_noise
        Standard deviation by which the residuals of each output are divided.
    accuracy
        Relative accuracy of the simulations; the number of substeps follows from it.
    memory
        Where outcomes are kept; a fit that was done before is not done again, and comes out the same.
    """

    def __init__(
        self,
        structure: Structure,
        records: Sequence[Record],
        scales: Mapping[str, float],
        output_noise: Mapping[str, float],
        accuracy: float = DEFAULT_ACCURACY,
        memory: FitMemory | None = None,
    ) -> None:
        self.structure = structure
        self.memory = memory
        self.scales = dict(scales)
        self.accuracy = accuracy
        sizes = [characteristic_value(dimension, scales) for dimension in structure.state_dimensions]
        self._state_sizes = np.array(sizes).reshape(-1, 1)
        self._limited = np.array([equation.limit is not None for equation in structure.equations], dtype=bool)
        names = [signal.name for signal in structure.rig.outputs]
        self._data = [self._prepared(record, names, output_noise) for record in records]
        self._problem: list[Any] = []
        if memory is not None:
            self._problem = [
                [str(equation) for equation in (*structure.equations, *structure.outputs)],
                list(structure.names),
                sorted(self.scales.items()),
                [record_digest(record) for record in records],
                [d.weights.tolist() for d in self._data],
                accuracy,
            ]
        self.n_samples = int(sum(np.count_nonzero(np.isfinite(d.measured)) for d in self._data))

    def _prepared(self, record: Record, names: Sequence[str], output_noise: Mapping[str, float]) -> _Data:
        missing = np.full(record.n_samples, np.nan)
        measured = np.column_stack([record.signals.get(n, missing) for n in names])
        weights = np.array([1.0 / output_noise[n] if n in record else 0.0 for n in names])
        guess = first_state(self.structure, record)
        return _Data(record, record_input(self.structure, record), measured, weights, guess)

    def fit(
        self,
        start: Mapping[str, float],
        free: Sequence[str],
        initial_states: Sequence[NDArray[np.float64]] | None = None,
        max_evaluations: int = 60,
        tolerance: float = 1e-7,
        finish: bool = True,
        substeps: Sequence[int] | None = None,
    ) -> FitResult:
        """Fit the free parameters and every record's initial state.

        Parameters
        ----------
        start
            Value of every parameter of the structure.
        free
            Names of those to fit; may be empty, then only initial states are.
        initial_states
            Start values per record, shape (n_states,) each; default from the first samples.
        max_evaluations
            Limit for the optimizer.
        tolerance
            Relative change of the cost at which the optimizer stops.
        finish
            Compute standard errors, and residuals with the accurate integrator. False for a first look.
        substeps
            Integration steps per sample of each record; default is chosen from the accuracy with the accurate integrator.

        Returns
        -------
        The result; ``success`` is False, with the reason as ``message``, where the start cannot be simulated or the
        optimizer ran out of evaluations.
        """
        coordinates = Coordinates.of(self.structure, free, start, self.scales)
        n_states = len(self.structure.states)
        states = list(initial_states) if initial_states is not None else self._first_states(start)
        own = coordinates.from_values(start)
        sizes = self.state_sizes(coordinates.to_parameters(own)[:, None])[:, 0]
        places = [np.where(self._limited, np.clip(s / sizes, -1.0, 1.0), s / sizes) for s in states]
        theta = np.concatenate([own, *places])
        lower = np.concatenate(
            [coordinates.lower, *(np.where(self._limited, -1.0, x - _STATE_RANGE) for x in places)]
        )
        upper = np.concatenate(
            [coordinates.upper, *(np.where(self._limited, 1.0, x + _STATE_RANGE) for x in places)]
        )
        problem = _Problem(self, coordinates, n_states, upper)
        if substeps is None:
            problem.choose_substeps(theta)
        else:
            problem.substeps = list(substeps)
        if not np.isfinite(problem.at(theta).cost):
            return self._failed(coordinates, theta, "The start values cannot be simulated.")
        if theta.size == 0:
            return self._result(problem, theta, True, "Nothing to fit.", finish)
        key = self._key(coordinates, start, theta, (max_evaluations, tolerance, problem.substeps))
        known = None if self.memory is None else self.memory.recall(key)
        if known is not None:
            problem.n_evaluations = known["evaluations"] - 1
            problem.substeps = list(known["substeps"])
            return self._result(problem, np.array(known["theta"]), known["success"], known["message"], finish)
        for _ in range(_MOST_ROUNDS if finish and substeps is None else 1):
            solution = least_squares(
                problem.residual,
                theta,
                jac=problem.jacobian,
                bounds=(lower, upper),
                method="trf",
                x_scale="jac",
                ftol=tolerance,
                xtol=0.1 * tolerance,
                gtol=1e-3 * tolerance,
                max_nfev=max_evaluations,
            )
            theta = solution.x
            # A time constant on its way to zero is held back where steps chosen for a longer one become unstable.
            if not (finish and substeps is None and problem.refined(theta)):
                break
        success = bool(solution.status > 0)
        result = self._result(problem, theta, success, solution.message, finish)
        if self.memory is not None:
            outcome = {"theta": theta.tolist(), "success": success, "message": solution.message}
            steps = {"evaluations": result.n_evaluations, "substeps": problem.substeps}
            self.memory.remember(key, {**outcome, **steps})
        return result

    def _key(
        self,
        coordinates: Coordinates,
        start: Mapping[str, float],
        theta: NDArray[np.float64],
        settings: tuple[int, float, list[int]],
    ) -> str:
        if self.memory is None:
            return ""
        values = [float(start[name]) for name in self.structure.names]
        return fit_key([*self._problem, values, list(coordinates.free)], theta, settings)

    def _first_states(self, start: Mapping[str, float]) -> list[NDArray[np.float64]]:
        """Return each record's guess; of several for states with a range, and of moving and resting, the best."""
        guesses = [d.first_state for d in self._data]
        if not np.any(self._limited):
            return guesses
        p = np.array([start[name] for name in self.structure.names])
        ranges = np.where(self._limited, self.state_sizes(p[:, None])[:, 0], 0.0)
        found = []
        for data, guess in zip(self._data, guesses, strict=True):
            at_rest = state_at_rest(self.structure, data.record, guess)
            lanes = np.column_stack([g + place * ranges for place in _FIRST_PLACES for g in (guess, at_rest)])
            n_samples = data.record.n_samples
            with np.errstate(all="ignore"):
                sets = np.repeat(p[:, None], lanes.shape[1], axis=1)
                out = simulate_sets(self.structure, data.held, sets, lanes, n_samples, _FIRST_SUBSTEPS)
                errors = (data.measured[:, :, None] - out) * data.weights[:, None]
                costs = np.nansum(errors**2, axis=(0, 1))
            costs[~np.all(np.isfinite(out), axis=(0, 1))] = np.inf
            found.append(lanes[:, int(np.argmin(costs))] if np.any(np.isfinite(costs)) else guess)
        return found

    def _failed(self, coordinates: Coordinates, theta: NDArray[np.float64], message: str) -> FitResult:
        p = coordinates.to_parameters(theta[: len(coordinates.free)])
        n = len(coordinates.free)
        return FitResult(
            structure=self.structure,
            success=False,
            message=message,
            values=dict(zip(self.structure.names, map(float, p), strict=True)),
            standard_errors=dict.fromkeys(coordinates.free, float("inf")),
            initial_states=tuple(d.first_state for d in self._data),
            cost=float("inf"),
            n_samples=self.n_samples,
            n_evaluations=1,
            free=coordinates.free,
            covariance=np.full((n, n), np.inf),
            residuals=(),
            substeps=(_MOST_SUBSTEPS,) * len(self._data),
        )

    def _result(
        self, problem: _Problem, theta: NDArray[np.float64], success: bool, message: str, finish: bool
    ) -> FitResult:
        coordinates = problem.coordinates
        n_free = len(coordinates.free)
        p = coordinates.to_parameters(theta[:n_free])
        states = problem.states(theta)
        cost = problem.at(theta).cost
        residuals: tuple[NDArray[np.float64], ...] = ()
        covariance = np.full((n_free, n_free), np.nan)
        if finish:
            try:
                residuals = tuple(
                    d.measured
                    - simulate_outputs(self.structure, d.held, p, s, d.record.n_samples, self.accuracy)
                    for d, s in zip(self._data, states, strict=True)
                )
            except SimulationError as error:
                return self._failed(coordinates, theta, str(error))
            cost = float(
                sum(np.nansum((r * d.weights) ** 2) for r, d in zip(residuals, self._data, strict=True))
            )
            outputs = [int(np.count_nonzero(d.weights)) for d in self._data]
            covariance = colored_covariance(problem.sensitivities(theta), n_free, outputs)
            covariance = propagated_covariance(covariance, coordinates.jacobian(theta[:n_free]))
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0)) if n_free else np.zeros(0)
        return FitResult(
            structure=self.structure,
            success=success,
            message=message,
            values=dict(zip(self.structure.names, map(float, p), strict=True)),
            standard_errors=dict(zip(coordinates.free, map(float, errors), strict=True)),
            initial_states=tuple(states),
            cost=cost,
            n_samples=self.n_samples,
            n_evaluations=problem.n_evaluations,
            free=coordinates.free,
            covariance=covariance,
            residuals=residuals,
            substeps=tuple(problem.substeps),
        )

    @property
    def data(self) -> list[_Data]:
        """The records as the fit sees them."""
        return self._data

    def state_sizes(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unit in which a fit moves each initial state, shape (n_states, n_sets).

        A state that cannot leave a range is moved in units of that range, whatever the parameters make of it: beyond an end
        nothing depends on it, and a fit that wandered there would not come back.
        """
        sizes = np.repeat(self._state_sizes, p.shape[1], axis=1)
        if np.any(self._limited):
            limits = state_limits(self.structure, p)
            sizes[self._limited] = np.maximum(limits[self._limited], _LEAST_RANGE * sizes[self._limited])
        return sizes


@dataclass(frozen=True)
class _Evaluation:
    theta: NDArray[np.float64]
    cost: float
    normal: NDArray[np.float64]
    gradient: NDArray[np.float64]


class _Problem:
    """Cost, gradient and Gauss-Newton matrix as functions of the coordinates, with the last evaluation kept."""

    def __init__(
        self,
        fit: GreyBoxFit,
        coordinates: Coordinates,
        n_states: int,
        upper: NDArray[np.float64],
    ) -> None:
        self.fit = fit
        self.coordinates = coordinates
        self.n_states = n_states
        self.upper = upper
        self.n_free = len(coordinates.free)
        self.n_evaluations = 0
        self.substeps = [_MOST_SUBSTEPS] * len(fit.data)
        self._last: _Evaluation | None = None
        self._best = float("inf")

    def states(self, theta: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return the initial states per record."""
        places = theta[self.n_free :].reshape(len(self.fit.data), self.n_states)
        sizes = self.fit.state_sizes(self.coordinates.to_parameters(theta[: self.n_free])[:, None])[:, 0]
        return [row * sizes for row in places]

    def choose_substeps(self, theta: NDArray[np.float64]) -> None:
        """Choose the substeps of each record from the accuracy wish at these coordinates."""
        p = self.coordinates.to_parameters(theta[: self.n_free])
        for i, (data, state) in enumerate(zip(self.fit.data, self.states(theta), strict=True)):
            try:
                self.substeps[i] = choose_substeps(
                    self.fit.structure,
                    data.held,
                    p,
                    state,
                    data.record.n_samples,
                    self.fit.accuracy,
                    _MOST_SUBSTEPS,
                )
            except SimulationError:
                self.substeps[i] = _MOST_SUBSTEPS

    def refined(self, theta: NDArray[np.float64]) -> bool:
        """Double the substeps if the cost would then fall further from here; return True if so."""
        before = self.substeps
        within_reach = self._removable(theta)
        self.substeps = [min(2 * n, _MOST_SUBSTEPS) for n in before]
        self._last = None
        if self.substeps != before and self._removable(theta) > within_reach + _WORTH_REFINING:
            self._best = float("inf")
            return True
        self.substeps, self._last = before, None
        return False

    def _removable(self, theta: NDArray[np.float64]) -> float:
        """Return the share of the cost that a full Gauss-Newton step promises to remove."""
        evaluation = self.at(theta)
        if not np.isfinite(evaluation.cost):
            return 0.0
        _, projection = _compressed(evaluation)
        return float(projection @ projection) / max(evaluation.cost, 1e-300)

    def residual(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a vector with the same cost and the same projection on the derivatives as the residuals."""
        evaluation = self.at(theta)
        if not np.isfinite(evaluation.cost):
            stand_in = np.zeros(theta.size + 1)
            stand_in[-1] = np.sqrt(_WORSE * self._best)
            return stand_in
        _, projection = _compressed(evaluation)
        rest = max(evaluation.cost - float(projection @ projection), 0.0)
        return np.append(projection, np.sqrt(rest))

    def jacobian(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives that go with `residual`."""
        root, _ = _compressed(self.at(theta))
        return np.vstack([root, np.zeros(theta.size)])

    def at(self, theta: NDArray[np.float64]) -> _Evaluation:
        """Evaluate, or return the last evaluation if it was here."""
        if self._last is not None and np.array_equal(self._last.theta, theta):
            return self._last
        n = theta.size
        normal, gradient, cost = np.zeros((n, n)), np.zeros(n), 0.0
        for index, (residual, derivative) in enumerate(self.sensitivities(theta)):
            columns = self._columns(index)
            # A diverging simulation overflows here; that is what the check below is for.
            with np.errstate(over="ignore", invalid="ignore"):
                cost += float(residual @ residual)
                normal[np.ix_(columns, columns)] += derivative.T @ derivative
                gradient[columns] += derivative.T @ residual
        if not (np.isfinite(cost) and np.all(np.isfinite(normal))):
            cost = float("inf")
        self._best = min(self._best, cost)
        self._last = _Evaluation(theta.copy(), cost, normal, gradient)
        self.n_evaluations += 1
        return self._last

    def _columns(self, index: int) -> NDArray[np.intp]:
        own = self.n_free + index * self.n_states + np.arange(self.n_states)
        return np.concatenate([np.arange(self.n_free), own]).astype(np.intp)

    def sensitivities(
        self, theta: NDArray[np.float64]
    ) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Return per record the weighted residuals (n,) and their derivatives (n, n_free + n_states)."""
        shifts = np.where(theta + STEP > self.upper, -STEP, STEP)
        base = self.coordinates.to_parameters(theta[: self.n_free])
        shifted = []
        for i in range(self.n_free):
            moved = theta[: self.n_free].copy()
            moved[i] += shifts[i]
            shifted.append(self.coordinates.to_parameters(moved))
        p = np.column_stack([base, *shifted, *[base] * self.n_states])
        sizes = self.fit.state_sizes(p)
        results = []
        for index, data in enumerate(self.fit.data):
            columns = self._columns(index)
            step = shifts[columns]
            places = np.repeat(theta[columns[self.n_free :], None], p.shape[1], axis=1)
            for i in range(self.n_states):
                places[i, 1 + self.n_free + i] += step[self.n_free + i]
            x0 = places * sizes
            with np.errstate(all="ignore"):
                out = simulate_sets(
                    self.fit.structure, data.held, p, x0, data.record.n_samples, self.substeps[index]
                )
                results.append(_weighted(data, out, step))
        return results


def _weighted(
    data: _Data, out: NDArray[np.float64], step: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    residuals, derivatives = [], []
    for i, weight in enumerate(data.weights):
        if weight > 0.0:
            residuals.append((data.measured[:, i] - out[:, i, 0]) * weight)
            derivatives.append((out[:, i, :1] - out[:, i, 1:]) * (weight / step))
    return np.concatenate(residuals), np.concatenate(derivatives)


def _compressed(evaluation: _Evaluation) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return R and c with R^T R = J^T J and R^T c = J^T r, also where the derivatives are dependent."""
    size = np.sqrt(np.diag(evaluation.normal))
    size[size == 0.0] = 1.0
    eigenvalues, vectors = np.linalg.eigh(evaluation.normal / np.outer(size, size))
    kept = np.maximum(eigenvalues, 0.0)
    floor = 1e-13 * max(float(kept[-1]), 1e-300)
    root = np.sqrt(kept)
    inverse = np.where(kept > floor, 1.0 / np.where(kept > floor, root, 1.0), 0.0)
    projection = inverse * (vectors.T @ (evaluation.gradient / size))
    return (root[:, None] * vectors.T) * size, projection
