"""Standard errors by a parametric bootstrap: the fitted model is simulated with disturbance forces and sensor noise.

The covariance formula treats the residual as noise of a certain spectrum added to the outputs. This is not sufficient if a
disturbance force decides when friction slips, play is crossed or a stop is hit: it shifts the events that determine the
parameters. So many draws of the disturbance are simulated with the model and its effects, and one Gauss-Newton step of the fit
gives the parameters of each draw.

References
----------
B. Efron and R. J. Tibshirani, *An Introduction to the Bootstrap* (Chapman and Hall 1993), sections 6.5 and 19.3, for the
parametric bootstrap and the number of draws. A. C. Davison and D. V. Hinkley, *Bootstrap Methods and their Application*
(Cambridge 1997), section 2.7, for one step instead of a new fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import BOOTSTRAP
from rigsight.diagnose.replicates import FEWEST, SLOWER, Replicates, Sources, likeliest_sources
from rigsight.diagnose.result import Candidate, Diagnosis, StdMethod
from rigsight.errors import SimulationError
from rigsight.identify import FitResult, OneStep
from rigsight.records.record import Floats

_STREAM = 1
"""Beside the seed: other draws of a diagnosis stay what they are without these."""


_Shown = list[tuple[Floats, Floats]]
"""A white force along each record and its effect on the residual, shapes (n_samples, n_draws) and (n_samples, n_outputs,
n_draws)."""

_AT_ONCE = 4_000_000
"""Readings that are kept at a time: 32 MB."""
_UNIT_DRAWS = 4
"""Draws by which each joint shows: what a force shows beside a linear response is averaged over them."""
_SETTING_DRAWS = 8
"""Draws by which sizes are set right."""
_FIRST = 1e-3
"""Part of the residual that a force of the first trial size must cause, to extrapolate the size that causes all of it."""
_SIZING_ROUNDS, _MOST_GROWN = 4, 100.0
"""Number and largest factor of the steps in which a first size grows, starting as low as a ten-billionth of the residual."""
_MOST_CHANGED = 10.0
"""Factor by which sizes of forces are set right at most."""
_SHOWS = 0.05
"""Share of the power that forces must leave above the noise for their sizes to be set right: less is told by chance."""


@dataclass(frozen=True)
class Uncertainty:
    """Standard errors of a fitted model."""

    std: dict[str, float]  # by name of the fitted parameters, infinite where the records do not determine one
    covariance: Floats  # shape (n_free, n_free), in the order of the fit's `free`
    # ``"bootstrap"``, or ``"formula"`` where the model cannot be simulated under such forces, or not in
    # reasonable time.
    method: StdMethod
    # The disturbance forces and the noise of the draws, noise in SI units; None for the formula.
    sources: Sources | None = None


def uncertainty_of(
    context: FitContext, fit: FitResult, rng: np.random.Generator, n_replicates: int | None = None
) -> Uncertainty:
    """Return the standard errors of a model that was fitted to the context's estimation records."""
    by_formula = Uncertainty(dict(fit.standard_errors), fit.covariance, "formula")
    if not (fit.free and fit.residuals and max(r.shape[0] for r in fit.residuals) >= FEWEST):
        return by_formula
    try:
        replicates = Replicates(context, fit)
        if replicates.n_steps > BOOTSTRAP.most_replicate_steps:
            return by_formula
        wanted = n_replicates or int(
            np.clip(
                BOOTSTRAP.replicate_steps // max(replicates.n_steps, 1),
                BOOTSTRAP.fewest_replicates,
                BOOTSTRAP.replicates,
            )
        )
        step = OneStep(context.problem(fit.structure, context.estimation), fit)
        sources = _sources(context, fit, step, replicates, rng)
        n_readings = sum(record.n_samples for record in context.estimation) * len(context.rig.outputs)
        batch = max(1, _AT_ONCE // n_readings)
        gradients = [
            step.gradients(replicates.drawn(sources, min(batch, wanted - first), rng))
            for first in range(0, wanted, batch)
        ]
    except SimulationError:
        return by_formula
    covariance = step.covariance(np.hstack(gradients))
    if np.any(np.isnan(covariance)):
        return by_formula
    # Parameters that the covariance formula calls undetermined stay undetermined.
    unknown = np.isinf(np.diag(fit.covariance))
    covariance[unknown, :] = covariance[:, unknown] = 0.0
    covariance[unknown, unknown] = np.inf
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return Uncertainty(dict(zip(fit.free, map(float, errors), strict=True)), covariance, "bootstrap", sources)


def _sources(
    context: FitContext, fit: FitResult, step: OneStep, replicates: Replicates, rng: np.random.Generator
) -> Sources:
    """Return the forces and the noise that explain the residual of the model."""
    names = [signal.name for signal in fit.structure.rig.outputs]
    # Outputs in no record have no floor; their residuals are left out.
    noise = np.array([context.noise.get(name, 1.0) for name in names])
    records = context.estimation
    remainder = [np.nan_to_num(own) / noise for own in fit.residuals]
    n_joints = len(fit.structure.rig.mechanism.joints)
    typical = 1.0 / context.scales["time"]
    corners = np.array([np.inf, *(slower * typical for slower in SLOWER)])

    def shown(joint: int, size: float, n_draws: int) -> _Shown:
        """Return white forces of one size at a joint and their effect on the residual, by record."""
        forces = [np.zeros((r.n_samples, n_joints, n_draws)) for r in records]
        for own in forces:
            own[:, joint] = size * rng.standard_normal((own.shape[0], n_draws))
        remainder = step.remainder(replicates.responses(forces))
        return [(force[:, joint], rest) for force, rest in zip(forces, remainder, strict=True)]

    def excited(sensor: int) -> _Shown:
        """Return white noise of a sensor, in units of its size, and its effect on the residual, by record."""
        unit = [np.zeros((r.n_samples, noise.size, _UNIT_DRAWS)) for r in records]
        for own in unit:
            own[:, sensor] = rng.standard_normal((own.shape[0], _UNIT_DRAWS))
        rests = step.remainder(replicates.with_noise([own * noise[:, None] for own in unit]))
        return [(own[:, sensor], rest) for own, rest in zip(unit, rests, strict=True)]

    whole = _mean_square(remainder)
    responses = []
    for joint in range(n_joints):
        size = _size_at(joint, context, shown, whole)
        if size == 0.0:
            responses.append([(np.ones((own.shape[0], 1)), np.zeros((*own.shape, 1))) for own in remainder])
        else:
            responses.append(shown(joint, size, _UNIT_DRAWS))
    found = likeliest_sources(
        remainder, [excited(i) for i in range(noise.size)], responses, [r.dt for r in records], corners
    )
    found = Sources(found.noise_std * noise, found.force_std, corners)
    return replace(found, force_std=_set_right(found, whole, step, replicates, rng) * found.force_std)


def _size_at(
    joint: int, context: FitContext, shown: Callable[[int, float, int], _Shown], whole: float
) -> float:
    """Return the white force at a joint that would cause about the whole residual; 0 where it shows in no sensor."""
    # The size is increased in small steps, because sticking friction hides a small force.
    name = context.rig.mechanism.joints[joint].name
    size = _FIRST * context.scales[f"force@{name}"]
    for _ in range(_SIZING_ROUNDS):
        reached = _mean_square([remainder for _, remainder in shown(joint, size, 1)])
        if not reached > 0.0:
            return 0.0
        factor = float(np.sqrt(whole / reached))
        size *= min(factor, _MOST_GROWN)
        if factor < 2.0:
            break
    return size


def _set_right(
    found: Sources,
    whole: float,
    step: OneStep,
    replicates: Replicates,
    rng: np.random.Generator,
) -> float:
    """Return the factor of the forces with which draws have the same residual as the model."""
    drawn = _mean_square(step.remainder(replicates.drawn(found, _SETTING_DRAWS, rng)))
    excited = [found.noise(r.n_samples, _SETTING_DRAWS, rng) for r in replicates.context.estimation]
    own = _mean_square(step.remainder(replicates.with_noise(excited)))
    wanted, reached = whole - own, drawn - own
    if min(wanted, reached) <= _SHOWS * whole:
        return 1.0
    return float(np.clip(np.sqrt(wanted / reached), 1.0 / _MOST_CHANGED, _MOST_CHANGED))


def _mean_square(remainder: Sequence[Floats]) -> float:
    """Return the mean square residual where it was measured; unmeasured outputs are 0 throughout."""
    total, count = 0.0, 0
    for own in remainder:
        seen = np.any(own != 0.0, axis=tuple(i for i in range(own.ndim) if i != 1))
        total += float(np.sum(own**2))
        count += int(np.count_nonzero(seen)) * own.size // own.shape[1]
    return total / max(count, 1)


def with_own_errors(diagnosis: Diagnosis, context: FitContext, model: FittedModel, seed: int) -> Diagnosis:
    """Return a diagnosis whose named candidate has standard errors of the bootstrap."""
    found = uncertainty_of(context, model.fit, np.random.default_rng([seed, _STREAM]))

    def own(candidate: Candidate) -> Candidate:
        if candidate.effects != model.names:
            return candidate
        estimates = {
            name: replace(estimate, std=found.std[name]) for name, estimate in candidate.parameters.items()
        }
        return replace(candidate, parameters=estimates, std_method=found.method)

    return replace(diagnosis, candidates=tuple(map(own, diagnosis.candidates)))
