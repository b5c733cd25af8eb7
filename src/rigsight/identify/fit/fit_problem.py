"""Cost, derivatives and Gauss-Newton matrix of an output-error fit as functions of its coordinates and initial states.

They come from one call of the kernel for all records. It integrates the derivatives together with the motion or, if that takes
longer, the current parameters and every shifted set in parallel lanes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import SimulationError
from rigsight.identify.fit.coordinates import FINE_STEP, STEP, Coordinates
from rigsight.identify.fit.covariance import symmetric_eigen
from rigsight.identify.fit.fit_data import FitData, weighted
from rigsight.records.record import Floats
from rigsight.simulate import (
    FittedRecord,
    Substeps,
    carries_tangents,
    differs_at_events,
    kernel_of,
    simulate_tangents,
)
from rigsight.simulate.side_by_side import choose_substeps

MOST_SUBSTEPS = 16
"""Largest number of substeps; a model that is too stiff for it is fitted with this number, and its residuals are recomputed
accurately."""
_STILL = 0.1
"""Share of the measured motion below which that of a model asks for no smaller steps (an assumption): a wrong model that stands
still needs no accuracy; one that moves about as far is fitted from there. With 1 a fit of free play was lost, not with 0.3."""
_WORTH_REFINING = 1e-3
"""Share of the cost by which finer steps must be expected to lower it, for a model near the noise floor."""
_MOST_WORTH = 1e-2
"""The same for a model far above the noise floor, half a percent of its error. With less, a time constant that the samples do not
resolve would tend to zero in ever finer steps for ever smaller gains, and many candidates could not be simulated from there."""
_FAR = 10.0
"""Error in units of the noise that counts as far above it: benches of the catalogue are judged from ten floors on."""
_WORSE = 1e3
_DIVERGED = 1e100
"""Sum of squares, in units of the noise, above which a simulation counts as diverged."""


@dataclass(frozen=True)
class Evaluation:
    """Cost r^T r, J^T J and J^T r at coordinates."""

    theta: Floats
    cost: float
    normal: Floats
    gradient: Floats

    @cached_property
    def compressed(self) -> tuple[Floats, Floats]:
        """R and c with R^T R = J^T J and R^T c = J^T r, also for linearly dependent derivatives."""
        # For a column of zeros, J^T J has a one on its diagonal.
        size = np.sqrt(np.diag(self.normal))
        size[size == 0.0] = 1.0
        correlation = self.normal / np.outer(size, size)
        # So what has no effect, such as the velocity of a joint that sticks, keeps its value; with a column of zeros the steps
        # of the optimizer become tiny in all coordinates.
        np.fill_diagonal(correlation, 1.0)
        eigenvalues, vectors = symmetric_eigen(correlation)
        kept = np.maximum(eigenvalues, 0.0)
        floor = 1e-13 * max(float(kept[-1]), 1e-300)
        root = np.sqrt(kept)
        inverse = np.where(kept > floor, 1.0 / np.where(kept > floor, root, 1.0), 0.0)
        projection = inverse * (vectors.T @ (self.gradient / size))
        return (root[:, None] * vectors.T) * size, projection


class Problem:
    """Cost, gradient and Gauss-Newton matrix as functions of the coordinates, with the last evaluation kept."""

    def __init__(self, data: FitData, coordinates: Coordinates, n_states: int, upper: Floats) -> None:
        self.data = data
        self.coordinates = coordinates
        self.n_states = n_states
        self.upper = upper
        has_events = bool(np.any(data.limited)) or differs_at_events(data.structure)
        self.steps = np.full(upper.size, STEP if has_events else FINE_STEP)
        self.derivative_error = (
            0.0 if carries_tangents(data.structure) else float(np.max(self.steps, initial=0.0))
        )
        self.n_free = len(coordinates.free)
        self.n_evaluations = 0
        self.substeps = [Substeps(MOST_SUBSTEPS)] * len(data.records)
        self._fitted: list[FittedRecord] = []
        self._fitted_with: list[Substeps] = []
        self._last: Evaluation | None = None
        self._best = float("inf")

    def states(self, theta: Floats) -> list[Floats]:
        """Return the initial states per record."""
        places = theta[self.n_free :].reshape(len(self.data.records), self.n_states)
        sizes = self.data.state_sizes(self.coordinates.to_parameters(theta[: self.n_free])[:, None])[:, 0]
        return [row * sizes for row in places]

    def choose_substeps(self, theta: Floats) -> None:
        """Choose the substeps of each record that give the requested accuracy at these coordinates."""
        data, p = self.data, self.coordinates.to_parameters(theta[: self.n_free])
        states = self.states(theta)

        def chosen(index: int) -> Substeps:
            own, n = data.records[index], data.records[index].record.n_samples
            at, sizes = (own.parameters(p), states[index]), _STILL * own.spreads
            try:
                return choose_substeps(data.structure, own.held, *at, n, data.accuracy, MOST_SUBSTEPS, sizes)
            except SimulationError:
                return Substeps(MOST_SUBSTEPS)

        self.substeps = self.data.of_each_record(chosen)

    def refined(self, theta: Floats) -> bool:
        """Double the substeps if the cost could then be lowered further from here; return True if so."""
        before = self.substeps
        within_reach = self.removable(theta)
        self.substeps = [n.with_most(min(2 * n, MOST_SUBSTEPS)) for n in before]
        self._last = None
        if self.substeps != before:
            is_far = self.at(theta).cost > _FAR**2 * self.data.n_readings
            if self.removable(theta) > within_reach + (_MOST_WORTH if is_far else _WORTH_REFINING):
                self._best = float("inf")
                return True
        self.substeps, self._last = before, None
        return False

    def removable(self, theta: Floats) -> float:
        """Return the share of the cost by which a full Gauss-Newton step would lower it in the linear approximation."""
        evaluation = self.at(theta)
        if not np.isfinite(evaluation.cost):
            return 0.0
        _, projection = evaluation.compressed
        return float(projection @ projection) / max(evaluation.cost, 1e-300)

    def residual(self, theta: Floats) -> Floats:
        """Return a vector with the same cost and the same projection on the derivatives as the residuals."""
        evaluation = self.at(theta)
        if not np.isfinite(evaluation.cost):
            stand_in = np.zeros(theta.size + 1)
            stand_in[-1] = np.sqrt(_WORSE * self._best)
            return stand_in
        _, projection = evaluation.compressed
        rest = max(evaluation.cost - float(projection @ projection), 0.0)
        return np.append(projection, np.sqrt(rest))

    def jacobian(self, theta: Floats) -> Floats:
        """Return the derivatives of `residual`."""
        root, _ = self.at(theta).compressed
        return np.vstack([root, np.zeros(theta.size)])

    def at(self, theta: Floats) -> Evaluation:
        """Evaluate, or return the last evaluation if it was here."""
        if self._last is None or not np.array_equal(self._last.theta, theta):
            self._last = self._evaluation(theta.copy())
            self._best = min(self._best, self._last.cost)
            self.n_evaluations += 1
        return self._last

    def _evaluation(self, theta: Floats) -> Evaluation:
        # A diverging simulation overflows here; the check below detects it.
        with np.errstate(over="ignore", invalid="ignore"):
            products = np.array(self._products(theta))
            cost = float(np.sum(products[:, 0, 0]))
            normal, gradient = self._put_together(products[:, 1:, 1:], products[:, 0, 1:])
            cost += self.add_prior(theta, normal, gradient)
        if not (cost < _DIVERGED and np.all(np.abs(normal) < _DIVERGED)):
            cost = float("inf")
        return Evaluation(theta, cost, normal, gradient)

    def add_prior(self, theta: Floats, normal: Floats, gradient: Floats) -> float:
        """Add to the normal equations what is known beside the records, and return its cost."""
        prior = self.data.prior
        # Beside initial states alone it would only hide how far they are from settled.
        if prior is None or not self.n_free:
            return 0.0
        return prior.add(self.coordinates, theta[: self.n_free], self.data.n_readings, normal, gradient)

    def _put_together(self, products: Floats, projections: Floats) -> tuple[Floats, Floats]:
        """Return the normal equations of all coordinates from those of each record for parameters and its own initial states."""
        n_records, free = products.shape[0], slice(None, self.n_free)
        own = self.n_free + np.arange(n_records * self.n_states).reshape(n_records, self.n_states)
        size = self.n_free + own.size
        normal, gradient = np.zeros((size, size)), np.zeros(size)
        normal[free, free] = np.sum(products[:, free, free], axis=0)
        between = np.moveaxis(products[:, free, self.n_free :], 0, 1).reshape(self.n_free, own.size)
        normal[free, self.n_free :], normal[self.n_free :, free] = between, between.T
        normal[own[:, :, None], own[:, None, :]] = products[:, self.n_free :, self.n_free :]
        gradient[free] = np.sum(projections[:, free], axis=0)
        gradient[self.n_free :] = projections[:, self.n_free :].ravel()
        return normal, gradient

    def columns(self, index: int) -> NDArray[np.intp]:
        """Return the indices of the coordinates on which a record depends: the parameters and its own initial states."""
        own = self.n_free + index * self.n_states + np.arange(self.n_states)
        return np.concatenate([np.arange(self.n_free), own]).astype(np.intp)

    def sensitivities(self, theta: Floats) -> list[tuple[Floats, Floats]]:
        """Return, for each record, the weighted residuals (n,) and their derivatives (n, n_free + n_states)."""
        data = self.data
        if carries_tangents(data.structure):
            p, dp, x0, dx0 = self._place(theta)

            def tangents(index: int) -> tuple[Floats, Floats]:
                own, n = data.records[index], data.records[index].record.n_samples
                with np.errstate(all="ignore"):
                    at = own.parameters(p), dp, x0[index], dx0
                    out = simulate_tangents(data.structure, own.held, *at, n, self.substeps[index])
                    # `weighted` expects outputs of sets, here of sets that differ by a unit step.
                    out[:, :, 1:] += out[:, :, :1]
                    return weighted(own, out)

            return data.of_each_record(tangents)
        shifts, sets, states = self._sets(theta)

        def differences(index: int) -> tuple[Floats, Floats]:
            residual, changes = self._differences(index, sets, states[index])
            with np.errstate(all="ignore"):
                changes /= shifts[self.columns(index)]
            return residual, changes

        return data.of_each_record(differences)

    def _place(self, theta: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return parameters, initial states and their derivatives by the coordinates on which a record depends."""
        # Shapes (n_parameters,), (n_parameters, n), (n_records, n_states) and (n_states, n) with n = n_free + n_states.
        # Structures for which this is called have no limited states, so that the units of states do not depend on the parameters.
        own = theta[: self.n_free]
        p = self.coordinates.to_parameters(own)
        sizes = self.data.state_sizes(p[:, None])[: self.n_states, 0]
        dp = np.hstack([self.coordinates.derivatives(own), np.zeros((p.size, self.n_states))])
        dx0 = np.hstack([np.zeros((self.n_states, self.n_free)), np.diag(sizes)])
        return p, dp, theta[self.n_free :].reshape(len(self.data.records), self.n_states) * sizes, dx0

    def _sets(self, theta: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the shift of each coordinate, and the sets of which differences are taken: the point and each shifted point."""
        # The sets are parameters, shape (n_parameters, n_sets), and initial states, shape (n_records, n_states, n_sets).
        shifts = np.where(theta + self.steps > self.upper, -self.steps, self.steps)
        base = self.coordinates.to_parameters(theta[: self.n_free])
        shifted = []
        for i in range(self.n_free):
            moved = theta[: self.n_free].copy()
            moved[i] += shifts[i]
            shifted.append(self.coordinates.to_parameters(moved))
        p = np.column_stack([base, *shifted, *[base] * self.n_states])
        places = theta[self.n_free :].reshape(len(self.data.records), self.n_states)
        states = np.repeat(places[:, :, None], p.shape[1], axis=2)
        own = np.arange(self.n_states)
        states[:, own, 1 + self.n_free + own] += shifts[self.n_free :].reshape(places.shape)
        return shifts, p, states * self.data.state_sizes(p)

    def _products(self, theta: Floats) -> list[Floats]:
        """Return each record's products of residual and derivatives, shape (1 + n, 1 + n), n = n_free + n_states."""
        data = self.data
        if data.structure.is_shifted or data.structure.late_inputs is None:
            columns = [np.column_stack(parts) for parts in self.sensitivities(theta)]
            return [np.asarray(own.T @ own) for own in columns]
        kernel = kernel_of(data.structure)
        fitted, lengths = self._fitted_records(), [record.record.n_samples for record in data.records]
        if carries_tangents(data.structure):
            p, dp, x0, dx0 = self._place(theta)
            return data.threads.results_of_shares(
                self._of_equal_rigs(
                    p,
                    lambda own, share: kernel.tangent_equations(
                        [fitted[i] for i in share], own, dp, x0[share], dx0
                    ),
                ),
                lengths,
            )
        shifts, sets, states = self._sets(theta)
        products = data.threads.results_of_shares(
            self._of_equal_rigs(
                sets,
                lambda own, share: kernel.normal_equations([fitted[i] for i in share], own, states[share]),
            ),
            lengths,
        )
        per_shift = [np.append(1.0, 1.0 / shifts[self.columns(index)]) for index in range(len(lengths))]
        return [own * np.outer(scale, scale) for own, scale in zip(products, per_shift, strict=True)]

    def _of_equal_rigs(
        self, p: Floats, several: Callable[[Floats, list[int]], Floats]
    ) -> Callable[[Sequence[int]], list[Floats]]:
        """Return a function of shares of the records that calls another one for each group with equal constants."""

        def of_share(share: Sequence[int]) -> list[Floats]:
            groups: dict[tuple[tuple[int, float], ...], list[int]] = {}
            for index in share:
                groups.setdefault(self.data.records[index].own, []).append(index)
            found: dict[int, Floats] = {}
            for group in groups.values():
                own = self.data.records[group[0]].parameters(p)
                found.update(zip(group, several(own, group), strict=True))
            return [found[index] for index in share]

        return of_share

    def _fitted_records(self) -> list[FittedRecord]:
        # Substeps with equal numbers may have different needs, so they are compared by identity.
        if list(map(id, self._fitted_with)) != list(map(id, self.substeps)):
            self._fitted_with = list(self.substeps)
            self._fitted = [
                FittedRecord(own.held, steps.per_piece(own.held.n_pieces), own.measured, own.weights)
                for steps, own in zip(self.substeps, self.data.records, strict=True)
            ]
        return self._fitted

    def _differences(self, index: int, p: Floats, x0: Floats) -> tuple[Floats, Floats]:
        """Return weighted residuals (n,) of the first set, and its outputs minus those of each other (n, n_sets - 1)."""
        record = self.data.records[index]
        with np.errstate(all="ignore"):
            return weighted(record, self.data.simulated(record, p, x0, self.substeps[index]))
