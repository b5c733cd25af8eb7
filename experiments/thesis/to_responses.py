"""Which hysteresis parameters follow a family of frequency responses, one per amplitude?"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares
from swept_response import SweptResponse

from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse
from rigsight.identify.fit.coordinates import STEP, Coordinates
from rigsight.identify.fit.covariance import colored_covariance, propagated_covariance
from rigsight.identify.fit.fit_data import FitResult
from rigsight.identify.hysteresis.calibration import (
    BEYOND,
    RELEASE_GAIN,
    Calibration,
    Minimum,
    SearchBox,
    checked_free,
    search,
    special_structure,
    start_values,
)
from rigsight.identify.hysteresis.derived import derived_quantities
from rigsight.identify.transfer.transfer_function import fit_frequency_response
from rigsight.simulate import Structure

LEAST_ERROR = 0.003
"""Relative error below which no line of a measured response is believed: estimators and integration differ by as much."""
_UNKNOWN_ERROR = 0.05
"""Relative error of lines without a variance; only its size relative to other responses matters."""
_SEARCH_SUBSTEPS = 2
_SUBSTEPS = 4
_NO_RESPONSE = 1e3


def calibrate_to_responses(
    structure: Structure,
    responses: Sequence[SweptResponse],
    constants: Mapping[str, float],
    rng: np.random.Generator,
    *,
    free: Sequence[str],
    start: Mapping[str, float] | None = None,
    with_phase: bool = True,
    spread: float = 10.0,
    n_generations: int = 100,
    n_sets: int = 96,
    n_ends: int = 6,
    progress: Callable[[str], None] | None = None,
) -> Calibration:
    """Calibrate a structure with hysteresis to frequency responses, measured with sweeps.

    Residuals are the logarithms of the magnitudes and the phases, over their standard errors where the responses have
    variances. Standard errors of the parameters follow from the residuals, colored along the frequency.

    Parameters
    ----------
    structure
        Rig whose input moves a mass, and effects; a number written into its equations stays.
    responses
        One or more per amplitude.
    constants
        The rig's constants by name.
    rng
        Random numbers of search and intervals.
    free
        Parameters to move.
    start
        Values of parameters that are known or of a simpler fit; inertia, damping and stiffness are found from a PT2 of each
        response where missing.
    with_phase
        False leaves the phases unread, as where a delay of the bench is in them.
    spread
        Factor around the start in which the rig's own parameters are searched.
    n_generations, n_sets, n_ends
        Size of the search and number of its ends that are refined, see `search`.
    progress
        Called with what has just been finished.

    Raises
    ------
    InputError
        If there are no responses, one does not fit the rig, a value is missing or unknown, or no set of the range can be
        simulated.
    """
    if not responses:
        raise InputError("A calibration needs at least one frequency response, got none.")
    for response in responses:
        response.check(structure)
    tell = progress or (lambda _: None)
    linear, scales = _linear_start(structure, responses, constants, start or {})
    begin = start_values(structure, linear)
    chosen = checked_free(structure, free)
    simple, simple_free = special_structure(structure, chosen)
    look = _Problem(Coordinates.of(simple, simple_free, begin, scales), responses, with_phase)
    box = SearchBox.around(look.coordinates, look.coordinates.from_values(begin), spread)
    ends = search(
        look.costs,
        box,
        rng,
        n_generations=n_generations,
        n_sets=n_sets,
        n_ends=n_ends,
        progress=lambda generation: tell(f"generation {generation}"),
    )
    rough = []
    for theta in ends:
        rough.append(look.refined(theta, 1e-4))
        tell("refined an end of the search")
    rough.sort(key=lambda solution: float(solution.cost))
    minima = tuple(
        Minimum(look.values(solution.x) | dict(simple.fixed), 2.0 * float(solution.cost) / look.n_residuals)
        for solution in rough
    )
    fit = _released(structure, chosen, simple, look.values(rough[0].x), scales, responses, with_phase)
    tell("refined the best")
    amplitudes = sorted(
        {float(np.max(r.measured.magnitude)) * r.amplitude for r in responses if _of_motion(structure, r)}
    )
    return Calibration(fit, derived_quantities(fit, amplitudes, scales, rng), minima)


def _of_motion(structure: Structure, response: SweptResponse) -> bool:
    return response.measured.response == structure.rig.outputs[0].name


def _linear_start(
    structure: Structure,
    responses: Sequence[SweptResponse],
    constants: Mapping[str, float],
    start: Mapping[str, float],
) -> tuple[dict[str, float], dict[str, float]]:
    """Return values of the rig and the sizes of base quantities from a PT2 of each response of the motion."""
    motion = structure.rig.motion
    drive = float(
        motion.drive_gain.subs(
            {s: constants.get(s.name, start.get(s.name)) for s in motion.drive_gain.free_symbols}
        )
    )
    largest = max(response.amplitude for response in responses)
    fits = [
        fit_frequency_response(r.measured, "pt2", weighting="relative").values
        for r in responses
        if _of_motion(structure, r)
    ]
    if not fits:
        raise InputError(
            f"A calibration needs at least one response of '{structure.rig.outputs[0].name}', where the spring acts."
        )
    stiffnesses = [drive / abs(fit["gain"]) for fit in fits]
    inertia = float(np.median([k / fit["omega_b"] ** 2 for k, fit in zip(stiffnesses, fits, strict=True)]))
    damping = min(2.0 * fit["zeta"] * k / fit["omega_b"] for k, fit in zip(stiffnesses, fits, strict=True))
    # The stiffness of the equations is that of small motion: the stiffest response comes nearest.
    own = {motion.stiffness: max(stiffnesses), motion.inertia: inertia, motion.damping: damping}
    values = {symbol.name: value for symbol, value in own.items() if symbol is not None}
    values = {**constants, **values, **start}
    x = max(float(np.max(r.measured.magnitude)) * r.amplitude for r in responses if _of_motion(structure, r))
    stiffness, mass = values[motion.stiffness.name], values[str(motion.inertia)]
    scales = {
        "x": x,
        "input": largest,
        "drive": abs(drive) * largest,
        "force": stiffness * x,
        "time": float(np.sqrt(mass / stiffness)),
        "length": 1.0,
    }
    return values, scales


class _Problem:
    """Residuals of all responses as functions of the coordinates, many sets at a time."""

    def __init__(
        self, coordinates: Coordinates, responses: Sequence[SweptResponse], with_phase: bool
    ) -> None:
        self.coordinates = coordinates
        self._responses = responses
        self._with_phase = with_phase
        self._weights = [1.0 / _relative_errors(response.measured) for response in responses]
        per_line = 2 if with_phase else 1
        self.n_residuals = per_line * sum(weight.size for weight in self._weights)
        self.n_evaluations = 0

    def residuals(self, thetas: NDArray[np.float64], *, quick: bool = False) -> list[NDArray[np.float64]]:
        """Return per response the weighted residuals, shape (n_parts, n_frequencies, n_sets): magnitude, then phase."""
        p = np.array([self.coordinates.to_parameters(theta) for theta in thetas]).T
        self.n_evaluations += 1
        found = []
        for response, weight in zip(self._responses, self._weights, strict=True):
            substeps = _SEARCH_SUBSTEPS if quick else _SUBSTEPS
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                values = response.predicted(self.coordinates.structure, p, substeps, quick)
                ratio = np.log(response.measured.values[:, None] / values)
            parts = [ratio.real, ratio.imag] if self._with_phase else [ratio.real]
            found.append(np.array(parts) * weight[:, None])
        return found

    def costs(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean squared residual, shape (n_sets,)."""
        with np.errstate(invalid="ignore", over="ignore"):
            total = sum(np.sum(part**2, axis=(0, 1)) for part in self.residuals(thetas, quick=True))
        return np.asarray(total / self.n_residuals)

    def vector(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return all residuals of one set, shape (n_residuals,)."""
        found = self._flat(self.residuals(theta[None]))[:, 0]
        return found if np.all(np.isfinite(found)) else np.full(found.size, _NO_RESPONSE)

    def jacobian(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return their derivatives, shape (n_residuals, n_free)."""
        return np.concatenate([part.reshape(-1, theta.size) for part in self.derivatives(theta)])

    def derivatives(self, theta: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return derivatives per response, shape (n_parts, n_frequencies, n_free), by differences inside the bounds."""
        inward = np.where(theta + STEP > self.coordinates.upper, -STEP, STEP)
        parts = self.residuals(np.concatenate([theta[None], theta + np.diag(inward)]))
        return [
            np.nan_to_num((part[..., 1:] - part[..., :1]) / inward, posinf=0.0, neginf=0.0) for part in parts
        ]

    def _flat(self, parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        return np.concatenate([part.reshape(-1, part.shape[-1]) for part in parts])

    def refined(self, theta: NDArray[np.float64], tolerance: float) -> OptimizeResult:
        """Return the local least-squares solution."""
        margin = 1e-9 * np.minimum(self.coordinates.upper - self.coordinates.lower, 1e6)
        return least_squares(
            self.vector,
            np.clip(theta, self.coordinates.lower + margin, self.coordinates.upper - margin),
            jac=self.jacobian,
            bounds=(self.coordinates.lower, self.coordinates.upper),
            x_scale="jac",
            ftol=tolerance,
            xtol=0.1 * tolerance,
            gtol=1e-10,
            max_nfev=80,
        )

    def values(self, theta: NDArray[np.float64]) -> dict[str, float]:
        """Return every parameter by name."""
        names = self.coordinates.structure.names
        return dict(zip(names, map(float, self.coordinates.to_parameters(theta)), strict=True))

    def result(self, solution: OptimizeResult) -> FitResult:
        """Return the solution with its uncertainty."""
        theta = solution.x
        parts, derivatives = self.residuals(theta[None]), self.derivatives(theta)
        blocks = [
            (residual[:, 0], derivative)
            for part, slopes in zip(parts, derivatives, strict=True)
            for residual, derivative in zip(part, slopes, strict=True)
        ]
        covariance = propagated_covariance(
            colored_covariance(blocks, theta.size), self.coordinates.jacobian(theta)
        )
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        free = self.coordinates.free
        return FitResult(
            structure=self.coordinates.structure,
            success=bool(solution.status > 0),
            message=str(solution.message),
            values=self.values(theta),
            standard_errors=dict(zip(free, map(float, errors), strict=True)),
            initial_states=(),
            cost=2.0 * float(solution.cost),
            n_samples=self.n_residuals,
            n_evaluations=self.n_evaluations,
            free=free,
            covariance=covariance,
            residuals=tuple(
                (part[:, :, 0] / weight).T for part, weight in zip(parts, self._weights, strict=True)
            ),
        )


def _released(
    structure: Structure,
    free: Sequence[str],
    simple: Structure,
    values: Mapping[str, float],
    scales: Mapping[str, float],
    responses: Sequence[SweptResponse],
    with_phase: bool,
) -> FitResult:
    """Refine to full precision: first with the special values, then released from them, then from beyond if that paid."""

    def refined(own: Structure, moved: Sequence[str], begin: Mapping[str, float]) -> FitResult:
        problem = _Problem(Coordinates.of(own, moved, begin, scales), responses, with_phase)
        return problem.result(problem.refined(problem.coordinates.from_values(begin), 1e-8))

    special = {name: value for name, value in simple.fixed if name in free}
    settled = refined(simple, [name for name in free if name not in special], values)
    if not special:
        return settled
    begin = {**settled.values, **dict(simple.fixed)}
    best = refined(structure, free, begin)
    if best.cost < settled.cost / RELEASE_GAIN:
        beyond = {**begin, **{name: BEYOND * value for name, value in special.items()}}
        best = min(best, refined(structure, free, beyond), key=lambda fit: fit.cost)
    return best


def _relative_errors(measured: FrequencyResponse) -> NDArray[np.float64]:
    """Return the standard error of logarithmic magnitude and phase [rad] of every line, shape (n_frequencies,)."""
    if measured.variance is None:
        return np.full(measured.omega.size, _UNKNOWN_ERROR)
    # Half of the variance belongs to the part along the value, half to the part across it.
    return np.asarray(np.hypot(np.sqrt(0.5 * measured.variance) / measured.magnitude, LEAST_ERROR))
