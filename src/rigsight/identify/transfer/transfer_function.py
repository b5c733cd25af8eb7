"""PT1 or PT2 from a measured frequency response: bounded grid search, then weighted least squares.

References
----------
R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapters 9 and 11, for the
maximum likelihood cost and its covariance. G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, for the optimal gain
at every point of the grid. W. K. Newey and K. D. West, Econometrica 55 (1987) 703, for dependent lines.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rigsight.errors import InputError, check_option
from rigsight.frequency import FrequencyResponse, hold_response
from rigsight.frequency.spectral import PlainRatio
from rigsight.identify.fit.covariance import propagated_covariance, sandwich_covariance
from rigsight.identify.information import POORLY_KNOWN
from rigsight.identify.transfer.transfer_form import Order, TransferFit, TransferForm
from rigsight.records.record import Floats

Weighting = Literal["variance", "uniform", "relative"]

_GRID_FREQUENCIES = 41
_GRID_DAMPINGS = np.geomspace(0.01, 10.0, 19)
_MOST_GRID_LINES = 500
_MOST_DEAD_TIMES = 80
_STARTS = 5
_BEYOND = 10.0
"""Factor beyond either end of the band within which a break frequency is searched."""
_DAMPING_RANGE = (1e-4, 1e3)
_STANDS_OUT = 4.0
"""Power of a line over its variance above which it is informative (two standard deviations)."""
_COHERENT = 0.05
MISFIT = 3.0
"""Residuals in units of the noise above which the order of a model is too low."""
_DIFFERENCE = 1e-5


def fit_frequency_response(
    measured: FrequencyResponse,
    order: Order,
    longest_dead_time: float = 0.0,
    magnitude_only: bool = False,
    weighting: Weighting | None = None,
) -> TransferFit:
    """Fit a PT1 or PT2 to a frequency response.

    Parameters
    ----------
    measured
        The frequency response; cut it with `FrequencyResponse.band` first. The free motion in a `PlainRatio` is fitted with the
        form.
    order
        ``"pt1"`` (thesis, 2.7) or ``"pt2"`` (2.9).
    longest_dead_time
        Longest dead time that is searched [s]; 0 fits none.
    magnitude_only
        Fit the magnitudes without the phase, as in the thesis's manual grid search (section 4.4). The sign of the gain is then
        positive by convention.
    weighting
        ``"variance"`` (maximum likelihood for circular normal errors), ``"uniform"`` (absolute errors) or ``"relative"``.
        Default: variances if there are any, else uniform.

    Returns
    -------
    The fit. Standard errors follow from the variances, widened by the misfit if that is above 1; without variances they follow
    from the residuals. ``success`` is False, with the reason as ``message``, if the optimizer did not converge or the band does
    not show the break frequency.

    Raises
    ------
    InputError
        If there are too few lines, too few exceed their uncertainty, the weighting needs variances that do not exist, or a dead
        time is requested with magnitudes only.
    """
    problem = _problem(measured, order, longest_dead_time, magnitude_only, weighting)
    thin = problem.thinned()
    rough = min((thin.fit(start) for start in thin.starts()), key=lambda found: float(found.cost))
    best = problem.fit(rough.x)
    values, chain = problem.form.natural(best.x)
    covariance = propagated_covariance(problem.covariance(best.x), np.diag(chain))
    errors = np.sqrt(np.diag(covariance))
    misfit = problem.misfit(best.x) if problem.weighting == "variance" else float("nan")
    notes = [] if best.status > 0 else [str(best.message)]
    notes += _band_notes(measured, float(values[1]), errors)
    success = not notes
    if magnitude_only:
        notes.append("Magnitudes show neither the sign of the gain (taken as positive) nor a dead time.")
    if misfit > MISFIT:
        notes.append(
            f"The residuals are {misfit:.1f} times larger than the variances explain: the model order is too low."
        )
    names = problem.form.names
    motion, motion_covariance = problem.free_motion(best.x)
    kind = "magnitude" if magnitude_only else "complex"
    return TransferFit(
        form=problem.form,
        names=names,
        values=dict(zip(names, map(float, values), strict=True)),
        standard_errors=dict(zip(names, map(float, errors), strict=True)),
        covariance=covariance,
        residuals=problem.errors(best.x),
        misfit=misfit,
        success=success,
        message=" ".join(notes) or "Converged.",
        source=measured.source,
        response=measured.response,
        unit=measured.unit,
        method=f"{kind} least squares, {problem.weighting} weights, on {measured.method or 'a frequency response'}",
        records=measured.records,
        free_motion=motion,
        free_motion_covariance=motion_covariance,
    )


@dataclass(frozen=True, eq=False)
class _Problem:
    """Weighted errors and their derivatives as functions of the parameter vector of a form."""

    form: TransferForm
    omega: Floats
    values: NDArray[np.complex128]
    weights: Floats
    """One over the standard deviation of a real component, shape (n_lines,)."""
    magnitude_only: bool
    weighting: Weighting
    longest_dead_time: float
    measured: FrequencyResponse

    def fitted(self, theta: Floats) -> NDArray[np.complex128]:
        """Return what the form shows at the lines, with the images of a held source around multiples of the sample rate."""
        ratio = self.measured
        if not isinstance(ratio, PlainRatio) or ratio.hold == "band_limited":
            return self.form.response(self.omega, theta)
        sampled = self.form.sampled_response(self.omega, ratio.dt, ratio.hold, theta)
        return np.asarray(sampled / hold_response(self.omega, ratio.dt, ratio.hold))

    def errors(self, theta: Floats) -> NDArray[np.complex128] | Floats:
        if self.magnitude_only:
            return np.asarray(np.abs(self.values) - np.abs(self.form.response(self.omega, theta)))
        remainder = self.values - self.fitted(theta)
        return remainder - self.free_motions(theta) @ self._free(theta, remainder)

    def residual(self, theta: Floats) -> Floats:
        return _components(self.errors(theta) * self.weights)

    def jacobian(self, theta: Floats) -> Floats:
        slopes = self.form.derivatives(self.omega, theta)
        if self.magnitude_only:
            fitted = self.form.response(self.omega, theta)
            size = np.abs(fitted)
            direction = fitted.conj() / np.where(size > 0.0, size, 1.0)
            return np.asarray(-np.real(direction[:, None] * slopes) * self.weights[:, None])
        weighted = _components(-self._with_moving_poles(theta, slopes) * self.weights[:, None])
        basis = np.linalg.qr(_components(self.free_motions(theta) * self.weights[:, None]))[0]
        return np.asarray(weighted - basis @ (basis.T @ weighted))

    def free_motions(self, theta: Floats) -> NDArray[np.complex128]:
        """Return the basis of the free motion in the values, shape (n_lines, n_motions); empty if they contain none."""
        if not isinstance(self.measured, PlainRatio):
            return np.zeros((self.omega.size, 0), dtype=np.complex128)
        return self.measured.free_motions(self.form.poles(theta))

    def _free(self, theta: Floats, remainder: NDArray[np.complex128]) -> Floats:
        """Return the best weights of the basis of the free motion in what the form leaves, shape (n_motions,)."""
        basis, remainder = self.free_motions(theta) * self.weights[:, None], remainder * self.weights
        return np.asarray(np.linalg.lstsq(_components(basis), _components(remainder), rcond=None)[0])

    def _with_moving_poles(self, theta: Floats, slopes: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Add the change of the free motion with the poles to the derivatives."""
        weights = self._free(theta, self.values - self.fitted(theta))
        if not weights.size:
            return slopes
        found = slopes.copy()
        for i in range(1, self.form.n_poles + 1):
            step = np.zeros_like(theta)
            step[i] = _DIFFERENCE
            change = self.free_motions(theta + step) - self.free_motions(theta - step)
            found[:, i] += change @ weights / (2.0 * _DIFFERENCE)
        return found

    def free_motion(self, theta: Floats) -> tuple[Floats, Floats]:
        """Return the weights of the free motion's basis and their covariance."""
        weights = self._free(theta, self.values - self.fitted(theta))
        slopes = self._with_moving_poles(theta, self.form.derivatives(self.omega, theta))
        columns = _components(np.hstack([self.free_motions(theta), slopes]) * self.weights[:, None])
        size = max(self.misfit(theta), 1.0)
        covariance = sandwich_covariance(columns.T @ columns, size**2 * (columns.T @ columns))
        return weights, covariance[: weights.size, : weights.size]

    def misfit(self, theta: Floats) -> float:
        residual = self.residual(theta)
        return float(np.sqrt(residual @ residual / (residual.size - theta.size)))

    def covariance(self, theta: Floats) -> Floats:
        slopes = self.jacobian(theta)
        filling = bread = slopes.T @ slopes
        if self.measured.noise_shares is not None:
            filling = self._shared_filling(theta)
        widened = 1.0
        if self.weighting == "variance":
            widened = max(self.misfit(theta), 1.0) ** 2 * _scattered_weights(self.measured.noise_freedom)
        elif self.measured.noise_shares is None:
            widened = self.misfit(theta) ** 2
        return sandwich_covariance(bread, widened * filling)

    def _shared_filling(self, theta: Floats) -> Floats:
        """Return the covariance of J^T r from the shares of each independent line of noise in all values."""
        shares, lines = self.measured.noise_shares, self.measured.noise_lines
        assert shares is not None
        assert lines is not None
        slopes: NDArray[np.complex128] = self.form.derivatives(self.omega, theta).conj()
        if self.magnitude_only:
            # The error of a magnitude is the component of the complex error along the fitted value.
            fitted = self.form.response(self.omega, theta)
            along = fitted.conj() / np.maximum(np.abs(fitted), np.finfo(np.float64).tiny)
            slopes = np.real(along[:, None] * slopes.conj()) * along[:, None]
        scores = (self.weights**2)[:, None, None] * slopes[:, None, :] * shares[:, :, None]
        first = int(lines.min())
        gathered = np.zeros((int(lines.max()) - first + 1, theta.size), dtype=np.complex128)
        np.add.at(gathered, lines - first, scores)
        filling = np.asarray(0.5 * np.real(gathered.conj().T @ gathered))
        if self.measured.bias is not None:
            # Unlike noise, a bias may point the same way at all lines.
            most = np.abs(slopes).T @ (self.weights**2 * self.measured.bias)
            filling += np.outer(most, most)
        return filling

    def fit(self, start: Floats) -> Any:
        """Return the result of the optimizer from a start."""
        lower, upper = self.bounds()
        inside = np.clip(start, lower, upper)
        return least_squares(
            self.residual, inside, jac=self.jacobian, bounds=(lower, upper), x_scale="jac", ftol=1e-12
        )

    def thinned(self) -> _Problem:
        """Return the problem on few lines, which suffice for the choice of a start."""
        every = slice(None, None, -(-self.omega.size // _MOST_GRID_LINES))
        kept = np.zeros(self.omega.size, dtype=np.bool_)
        kept[every] = True
        omega, weights, measured = self.omega[every], self.weights[every], self.measured.at(kept)
        return replace(self, omega=omega, values=self.values[every], weights=weights, measured=measured)

    def bounds(self) -> tuple[Floats, Floats]:
        low, high = self._reach()
        lower = self.form.vector(low, _DAMPING_RANGE[0], 0.0)
        upper = self.form.vector(high, _DAMPING_RANGE[1], max(self.longest_dead_time, 1e-12))
        lower[0], upper[0] = (0.0 if self.magnitude_only else -np.inf), np.inf
        return lower, upper

    def _reach(self) -> tuple[float, float]:
        positive = self.omega[self.omega > 0.0]
        return float(positive[0] / _BEYOND), float(positive[-1] * _BEYOND)

    def starts(self) -> list[Floats]:
        """Return the best points of the grid, each with its best gain."""
        omega, weights = self.omega, self.weights
        measured: NDArray[np.complex128] = self.values
        low, high = self._reach()
        goal = np.abs(measured) if self.magnitude_only else measured
        dampings = _GRID_DAMPINGS if self.form.order == "pt2" else np.ones(1)
        turns = int(np.ceil(self.longest_dead_time * float(omega[-1]))) + 1
        delays = np.linspace(0.0, self.longest_dead_time, min(2 * turns, _MOST_DEAD_TIMES))
        if self.longest_dead_time == 0.0:
            delays = np.zeros(1)
        # Advancing the measured phase by a dead time is equivalent to delaying the form.
        forward = np.exp(1j * np.outer(delays, omega))
        found = []
        for omega_b, zeta in itertools.product(np.geomspace(low, high, _GRID_FREQUENCIES), dampings):
            theta = self.form.vector(float(omega_b), float(zeta), 0.0)
            shape = weights * self.form.response(omega, theta)
            reported = (weights * goal).astype(np.complex128)
            if self.magnitude_only:
                shape = np.abs(shape).astype(np.complex128)
            else:
                basis = np.linalg.qr(_components(self.free_motions(theta) * weights[:, None]))[0]
                shape, reported = (_projected(vector, basis) for vector in (shape, reported))
            energy = float(np.sum(np.abs(shape) ** 2))
            crossed = shape.conj() * reported
            projections = np.real(forward @ crossed)
            if self.magnitude_only:
                projections = np.maximum(projections, 0.0)
            best = int(np.argmax(np.abs(projections)))
            theta = self.form.vector(float(omega_b), float(zeta), float(delays[best]))
            theta[0] = projections[best] / energy
            found.append((-float(projections[best] ** 2) / energy, theta))
        found.sort(key=lambda pair: pair[0])
        return [theta for _, theta in found[:_STARTS]]


def _problem(
    measured: FrequencyResponse,
    order: Order,
    longest_dead_time: float,
    magnitude_only: bool,
    weighting: Weighting | None,
) -> _Problem:
    check_option("order", order, ("pt1", "pt2"))
    if not (np.isfinite(longest_dead_time) and longest_dead_time >= 0.0):
        raise InputError(f"The longest dead time must be at least 0 s and finite, got {longest_dead_time!r}.")
    if magnitude_only and longest_dead_time > 0.0:
        raise InputError(
            "A dead time changes the phase only, so it cannot be found from magnitudes. Fit the complex values "
            "(magnitude_only=False) or omit the dead time."
        )
    form = TransferForm(order, longest_dead_time > 0.0)
    _check_informative(measured, form)
    known = measured.variance is not None and bool((measured.variance > 0.0).any())
    chosen: Weighting = weighting or ("variance" if known else "uniform")
    check_option("weighting", chosen, ("variance", "uniform", "relative"))
    size = measured.magnitude
    if chosen == "variance":
        if measured.variance is None or not known:
            raise InputError(
                f"Weighting by variance needs variances, and {measured.source} -> {measured.response} has none. "
                "Use weighting='uniform' or 'relative', or an estimator that gives variances."
            )
        least = 1e-9 * float(np.median(measured.variance[measured.variance > 0.0]))
        weights = np.sqrt(2.0 / np.maximum(measured.variance, least))
    elif chosen == "relative":
        weights = 1.0 / np.maximum(size, 1e-9 * float(np.max(size)))
    else:
        weights = np.full(size.size, 1.0 / float(np.max(size)))
    return _Problem(
        form, measured.omega, measured.values, weights, magnitude_only, chosen, longest_dead_time, measured
    )


def _check_informative(measured: FrequencyResponse, form: TransferForm) -> None:
    what = f"Frequency response {measured.source} -> {measured.response}"
    band = f"from {measured.omega[0]:.4g} to {measured.omega[-1]:.4g} rad/s"
    least = len(form.names) + 2
    if np.count_nonzero(measured.omega > 0.0) < least:
        raise InputError(
            f"{what}: {measured.omega.size} lines {band} are too few for {len(form.names)} parameters; at least {least} above "
            "0 rad/s are needed. Widen the band or use a longer record."
        )
    size = measured.magnitude
    telling = size > 0.0
    if measured.variance is not None:
        telling &= size**2 > _STANDS_OUT * measured.variance
    if measured.coherence is not None:
        telling &= measured.coherence > _COHERENT
    # In pure noise, a share of exp(-4) of the lines exceeds the limit by chance.
    needed = max(least, int(np.ceil(0.05 * size.size)))
    if np.count_nonzero(telling) < needed:
        raise InputError(
            f"{what}: only {np.count_nonzero(telling)} of {size.size} lines {band} exceed their uncertainty, {needed} are "
            f"needed. The record has no excitation in this band: choose one that '{measured.source}' drives, or drive it there."
        )


def _band_notes(measured: FrequencyResponse, omega_b: float, errors: Floats) -> list[str]:
    low, high = float(measured.omega[0]), float(measured.omega[-1])
    if np.all(np.isfinite(errors)) and errors[1] < POORLY_KNOWN * omega_b and low <= omega_b <= high:
        return []
    return [
        f"The band from {low:.4g} to {high:.4g} rad/s does not show the break frequency, fitted as {omega_b:.4g} rad/s: "
        "use a wider band or a record that drives it."
    ]


def _components(values: NDArray[np.complex128] | Floats) -> Floats:
    """Return real and imaginary part of each row next to each other, so that the parts of a line are adjacent."""
    if not np.iscomplexobj(values):
        return np.asarray(values, dtype=np.float64)
    parts = np.stack([values.real, values.imag], axis=1)
    return np.asarray(parts.reshape(2 * values.shape[0], *values.shape[1:]))


def _projected(values: NDArray[np.complex128], basis: Floats) -> NDArray[np.complex128]:
    """Return what an orthonormal basis of components leaves of some values, shape (n_lines,)."""
    if not basis.size:
        return values
    parts = _components(values)
    remainder = (parts - basis @ (basis.T @ parts)).reshape(-1, 2)
    return np.asarray(remainder[:, 0] + 1j * remainder[:, 1])


def _scattered_weights(freedom: float) -> float:
    """Return the factor on covariances for weights that are estimates themselves."""
    # A line whose variance was estimated too small gets too much weight, and its error is underestimated as well. For a
    # chi-squared variance x with n = 2 freedom degrees of freedom, the variance of the sum is E[1/x^2], the stated one E[1/x],
    # and the misfit contains E[1/x]: ``E[1/x^2] / E[1/x]^2 = (n - 2) / (n - 4)``.
    if not np.isfinite(freedom):
        return 1.0
    n = max(2.0 * freedom, 5.0)
    return (n - 2.0) / (n - 4.0)
