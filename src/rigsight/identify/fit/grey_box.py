"""Output-error fit of a structure's parameters, initial states included, to any number of records at once.

The optimizer is scipy's bounded trust-region least squares, applied to an equivalent compressed problem: it only uses J^T J,
J^T r and r^T r, so a square root of J^T J replaces the tall Jacobian.

References
----------
L. Ljung, *System Identification* (Prentice Hall 1999), chapters 7 and 9, for output error and its covariance with colored
residuals. M. A. Branch, T. F. Coleman and Y. Li, SIAM J. Sci. Comput. 21 (1999) 1, for the optimizer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rigsight.errors import InputError, SimulationError
from rigsight.identify.fit.coordinates import Coordinates
from rigsight.identify.fit.covariance import colored_covariance, propagated_covariance
from rigsight.identify.fit.fit_data import (
    FitData,
    FitMemory,
    FitResult,
    Prior,
    fit_key,
    record_data,
    record_digest,
)
from rigsight.identify.fit.fit_problem import MOST_SUBSTEPS, Evaluation, Problem
from rigsight.identify.fit.idle_threads import IdleThreads
from rigsight.identify.fit.search import (
    FINE_TOLERANCE,
    FreeRun,
    VariableProjection,
    off_kinks,
    searched,
    state_slopes,
)
from rigsight.identify.fit.settled_states import SearchStart
from rigsight.records.record import Floats, Record
from rigsight.simulate import Structure, Substeps, structure_of_fit
from rigsight.units import characteristic_value

DEFAULT_ACCURACY = 1e-4
"""Relative accuracy of simulations inside a fit: below the noise of any bench."""
_MOST_ROUNDS = 4
"""Largest number of successive searches with finer steps."""
_WORTH_A_ROUND = 1e-3
"""Share of the cost by which a round must have lowered it for another round."""
_Outcome = tuple[Floats, bool, str]
"""Coordinates and initial states at the end of a search, whether it converged, and the optimizer's message."""


class GreyBoxFit:
    """Output-error least squares of a structure on records.

    A record may lack sensors, but not the first one of a rig with one motion. Offsets that are free in one of them
    (`Record.free_offsets`) are estimated in each. An observer (`Record.observed`) is used in the fit, but is not part of the
    result. `scales` are those of `characteristic_scales`; residuals are divided by `output_noise`. The number of substeps
    follows from the relative accuracy of the simulations. If records tell how many of their first samples determine the
    initial state (`Record.starting_samples`), it is held at what these give, and the parameters are those of the free run. A
    prior counts in the search; cost and covariance of a finished fit are those of the records. A fit that the memory holds is
    not repeated and gives the same result.
    """

    def __init__(
        self,
        structure: Structure,
        records: Sequence[Record],
        scales: Mapping[str, float],
        output_noise: Mapping[str, float],
        accuracy: float = DEFAULT_ACCURACY,
        memory: FitMemory | None = None,
        threads: IdleThreads | None = None,
        prior: Prior | None = None,
    ) -> None:
        self.structure = structure
        self.memory = memory
        self.scales = dict(scales)
        simulated = structure_of_fit(structure, records)
        sizes = [characteristic_value(dimension, scales) for dimension in simulated.state_dimensions]
        names = [signal.name for signal in structure.rig.outputs]
        self.data = FitData(
            structure=simulated,
            records=tuple(record_data(simulated, record, names, output_noise) for record in records),
            limited=np.array([equation.limit is not None for equation in simulated.equations], dtype=bool),
            unlimited_sizes=np.array(sizes).reshape(-1, 1),
            accuracy=accuracy,
            threads=threads or IdleThreads(),
            prior=prior,
        )
        beginnings = [
            replace(record.slice(0, record.starting_samples), starting_samples=0)
            for record in records
            if record.starting_samples
        ]
        if beginnings and len(beginnings) < len(records):
            raise InputError("Either all records of a fit tell their starting samples, or none does.")
        self._beginnings = (
            GreyBoxFit(structure, beginnings, scales, output_noise, accuracy) if beginnings else None
        )
        self._problem: list[Any] = []
        if memory is not None:
            self._problem = [
                # Included because bounds and start values do not appear in the equations.
                dict(structure.rig.declaration),
                [
                    str(equation)
                    for equation in (*simulated.equations, *simulated.outputs, *simulated.steps.items())
                ],
                list(structure.names),
                sorted(self.scales.items()),
                [record_digest(record) for record in records],
                [d.weights.tolist() for d in self.data.records],
                accuracy,
                *(
                    [prior.names, prior.values.tolist(), prior.curvature.tolist()]
                    if prior is not None
                    else []
                ),
            ]
        self.n_samples = self.data.n_readings

    def fit(
        self,
        start: Mapping[str, float],
        free: Sequence[str],
        initial_states: Sequence[Floats] | None = None,
        max_evaluations: int = 60,
        tolerance: float = 1e-7,
        finish: bool = True,
        substeps: Sequence[int] | None = None,
    ) -> FitResult:
        """Fit the free parameters (there may be none) and every record's initial state.

        Without substeps and initial states these follow from the accuracy and from the first samples. `tolerance` is the
        relative change of the cost at which the optimizer stops; a rough fit (not `finish`) has no standard errors and no
        accurate residuals. ``success`` is False, with the reason as ``message``, if the start cannot be simulated or the
        optimizer ran out of evaluations.
        """

        def found(values: Mapping[str, float], states: Sequence[Floats] | None) -> FitResult:
            return self._fit(values, free, states, max_evaluations, tolerance, finish, substeps)

        if self._beginnings is None:
            return found(start, initial_states)
        result = found(start, self._beginnings.fit(start, (), finish=False).initial_states)
        for _ in range(_MOST_ROUNDS if free else 0):
            states = self._beginnings.fit(result.values, (), finish=False).initial_states
            before, result = result, found(result.values, states)
            if not abs(result.cost - before.cost) > _WORTH_A_ROUND * before.cost:
                break
        return result

    def _fit(
        self,
        start: Mapping[str, float],
        free: Sequence[str],
        initial_states: Sequence[Floats] | None,
        max_evaluations: int,
        tolerance: float,
        finish: bool,
        substeps: Sequence[int] | None,
    ) -> FitResult:
        """Search once."""
        as_given = self._beginnings is not None
        begin = SearchStart.of(self.data, self.scales, start, free, initial_states, as_given)
        coordinates, theta = begin.coordinates, begin.theta
        lower, upper = coordinates.lower, coordinates.upper
        if self._beginnings is None:
            lower, upper = np.concatenate([lower, *begin.lower]), np.concatenate([upper, *begin.upper])
            problem = Problem(self.data, coordinates, begin.n_states, upper)
        else:
            theta = theta[: len(free)]
            states = [] if initial_states is None else initial_states
            slopes = state_slopes(self._beginnings.data, self.scales, start, free, states)
            problem = FreeRun(self.data, begin, slopes)
        if substeps is None:
            problem.choose_substeps(theta)
        else:
            problem.substeps = [n if isinstance(n, Substeps) else Substeps(n) for n in substeps]
        if not np.isfinite(problem.at(theta).cost):
            return self._failed(problem, theta, "The start values cannot be simulated.")
        if theta.size == 0:
            return self._result(problem, theta, True, "Nothing to fit.", finish)

        def search(theta: Floats = theta) -> _Outcome:
            for _ in range(_MOST_ROUNDS if finish and substeps is None else 1):
                solution = searched(problem, theta, (lower, upper), tolerance, max_evaluations)
                theta = solution.x
                # A time constant that tends to zero stops where the steps chosen for a longer one become unstable.
                if not (finish and substeps is None and problem.refined(theta)):
                    break
            if finish and tolerance <= FINE_TOLERANCE and np.any(self.data.limited):
                settled = off_kinks(problem, theta, (lower, upper))
                if settled is not None:
                    return settled, True, "Steps from coarse finite differences have become zero."
            return theta, bool(solution.status > 0), str(solution.message)

        settings = [max_evaluations, tolerance, *map(int, problem.substeps), finish, substeps is None]
        outcome = self._recalled(problem, start, begin.theta, settings, search)
        return self._result(problem, *outcome, finish)

    def fit_windows(
        self,
        start: Mapping[str, float],
        free: Sequence[str],
        max_evaluations: int = 40,
        tolerance: float = 1e-5,
        most_rounds: int = 5,
    ) -> FitResult:
        """Fit the free parameters to many short records, each with the best initial state for the parameters.

        For motion with friction or hysteresis: there, `fit`, which varies everything together, can stop far from the minimum.
        Between rounds other values of limited states are tried.
        """
        begin = SearchStart.of(self.data, self.scales, start, free)
        coordinates, n_free = begin.coordinates, len(free)
        problem = VariableProjection(self.data, coordinates, begin.places, begin.lower, begin.upper)
        problem.choose_substeps(begin.theta)
        if not np.isfinite(problem.settle_anew(begin.theta[:n_free])):
            return self._failed(problem, begin.theta, "The start values cannot be simulated.")

        def search() -> _Outcome:
            own, success, message = begin.theta[:n_free], True, "Only initial states to fit."
            bounds, cost = (coordinates.lower, coordinates.upper), float("inf")
            for _ in range(most_rounds if free else 0):
                solution = searched(problem, own, bounds, tolerance, max_evaluations)
                own, success, message = solution.x, bool(solution.status > 0), str(solution.message)
                before, cost = cost, problem.settle_anew(own)
                if cost > (1.0 - _WORTH_A_ROUND) * before:
                    break
            return np.concatenate([own, *problem.places]), success, message

        settings = [max_evaluations, tolerance, *map(int, problem.substeps), most_rounds]
        outcome = self._recalled(problem, start, begin.theta, settings, search)
        together = Problem(self.data, coordinates, begin.n_states, problem.upper)
        together.substeps, together.n_evaluations = problem.substeps, problem.n_evaluations
        return self._result(together, *outcome, finish=True)

    def information(self, start: Mapping[str, float], free: Sequence[str]) -> Floats:
        """Return the information of the records on parameters at their start, with unknown initial states.

        This is the Fisher information of relative changes (of changes in units of the size, if a value is zero), shape
        (n_free, n_free); NaN if the start cannot be simulated.
        """
        normal = self.normal_equations(start, free).normal
        if not np.all(np.isfinite(normal)):
            return np.full_like(normal, np.nan)
        coordinates = Coordinates.of(self.data.structure, free, start, self.scales)
        sizes = np.array([abs(start[name]) for name in free])
        sizes = np.where(sizes > 0.0, sizes, coordinates.scale)
        relative = sizes / np.diag(coordinates.jacobian(coordinates.from_values(start)))
        return np.asarray(normal * np.outer(relative, relative))

    def normal_equations(
        self, start: Mapping[str, float], free: Sequence[str], initial_states: Sequence[Floats] | None = None
    ) -> Evaluation:
        """Return the normal equations of the free parameters' coordinates at their start, initial states projected out.

        The cost is that with the best initial states in the linear approximation.
        """
        begin, n = SearchStart.of(self.data, self.scales, start, free, initial_states), len(free)
        problem = Problem(self.data, begin.coordinates, begin.n_states, np.full(begin.theta.size, np.inf))
        problem.choose_substeps(begin.theta)
        whole = problem.at(begin.theta)
        normal, gradient = whole.normal, whole.gradient
        if not np.all(np.isfinite(normal)):
            return Evaluation(begin.theta[:n], np.inf, np.full((n, n), np.nan), np.full(n, np.nan))
        through = normal[:n, n:] @ np.linalg.pinv(normal[n:, n:], hermitian=True)
        settled = gradient[n:] @ np.linalg.pinv(normal[n:, n:], hermitian=True) @ gradient[n:]
        return Evaluation(
            begin.theta[:n],
            whole.cost - float(settled),
            normal[:n, :n] - through @ normal[n:, :n],
            gradient[:n] - through @ gradient[n:],
        )

    def _recalled(
        self,
        problem: Problem,
        start: Mapping[str, float],
        theta: Floats,
        settings: Sequence[float],
        search: Callable[[], _Outcome],
    ) -> _Outcome:
        """Return the outcome of a search, from memory if it was done before."""
        if self.memory is None:
            return search()
        values = [float(start[name]) for name in self.structure.names]
        key = fit_key([*self._problem, values, list(problem.coordinates.free)], theta, settings)
        known = self.memory.recall(key)
        if known is not None:
            problem.n_evaluations = known["evaluations"]
            problem.substeps = [
                own.with_most(most) for own, most in zip(problem.substeps, known["substeps"], strict=True)
            ]
            return np.array(known["theta"]), known["success"], known["message"]
        end, success, message = search()
        outcome = {"theta": end.tolist(), "success": success, "message": message}
        steps = {"evaluations": problem.n_evaluations, "substeps": list(map(int, problem.substeps))}
        self.memory.remember(key, {**outcome, **steps})
        return end, success, message

    def _failed(self, problem: Problem, theta: Floats, message: str) -> FitResult:
        n = problem.n_free
        problem.n_evaluations, problem.substeps = 1, [Substeps(MOST_SUBSTEPS)] * len(self.data.records)
        return self._found(problem, theta, (False, message), float("inf"), np.full((n, n), np.inf), ())

    def _result(
        self, problem: Problem, theta: Floats, success: bool, message: str, finish: bool
    ) -> FitResult:
        outcome, n_free = (success, message), problem.n_free
        own, states = theta[:n_free], problem.states(theta)
        evaluations, cost = problem.n_evaluations, problem.at(theta).cost
        # The evaluation at the end is no part of the search.
        problem.n_evaluations = evaluations
        if not finish:
            return self._found(problem, theta, outcome, cost, np.full((n_free, n_free), np.nan), ())
        p = problem.coordinates.to_parameters(own)

        def remainder(index: int) -> Floats:
            record = self.data.records[index]
            return record.measured - self.data.accurate(record, p, states[index], self.data.accuracy)

        try:
            residuals = tuple(self.data.of_each_record(remainder))
        except SimulationError as error:
            return self._failed(problem, theta, str(error))
        weights = [record.weights for record in self.data.records]
        cost = float(sum(np.nansum((r * w) ** 2) for r, w in zip(residuals, weights, strict=True)))
        covariance = np.zeros((0, 0))
        if n_free:
            sensitivities, outputs = problem.sensitivities(theta), [int(np.count_nonzero(w)) for w in weights]
            covariance = colored_covariance(
                sensitivities, n_free, outputs, problem.derivative_error, for_intervals=True
            )
            covariance = propagated_covariance(covariance, problem.coordinates.jacobian(own))
        return self._found(problem, theta, outcome, cost, covariance, residuals)

    def _found(
        self,
        problem: Problem,
        theta: Floats,
        outcome: tuple[bool, str],
        cost: float,
        covariance: Floats,
        residuals: tuple[Floats, ...],
    ) -> FitResult:
        free = problem.coordinates.free
        p = problem.coordinates.to_parameters(theta[: problem.n_free])
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return FitResult(
            structure=self.structure,
            success=outcome[0],
            message=outcome[1],
            # The bandwidths of an observer come after all other parameters.
            values=dict(zip(self.structure.names, map(float, p), strict=False)),
            standard_errors=dict(zip(free, map(float, errors), strict=True)),
            initial_states=tuple(problem.states(theta)),
            cost=cost,
            n_samples=self.n_samples,
            n_evaluations=problem.n_evaluations,
            free=free,
            covariance=covariance,
            residuals=residuals,
            substeps=tuple(problem.substeps),
            offset_names=self.data.structure.offsets,
        )
