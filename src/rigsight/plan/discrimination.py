"""By how much would a record separate rivals, each fitted again to all records?

References
----------
A. C. Atkinson and V. V. Fedorov, Biometrika 62 (1975) 57, for T-optimality: the readings of one model are worth what its best
rival leaves of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.diagnose.policy import FAMILIES
from rigsight.identify import GreyBoxFit
from rigsight.identify.fit.fit_data import FitData
from rigsight.identify.fit.settled_states import guessed_states
from rigsight.plan.rivals import Contest, Rival
from rigsight.records import Record
from rigsight.records.record import Floats
from rigsight.simulate import simulate

_ACCURACY = 1e-4
MOST = 1.0 - FAMILIES.failing
"""Largest probability, as of verdicts: so often the evidence itself fails."""


def predicted(rival: Rival, record: Record) -> Record:
    """Return a record with the readings that a rival predicts from rest."""
    return simulate(rival.fit.structure, rival.fit.values, record, accuracy=_ACCURACY)


def about(contest: Contest, rival: Rival, readings: Record) -> float:
    """Return the expected logarithm of the likelihood ratio against a rival whose numbers are fitted again, linearized.

    Parameters
    ----------
    contest
        The rivals.
    rival
        The one that is wrong.
    readings
        A record with the readings of the right one.
    """
    new, errors = contest.windowing.cut([readings]), contest.remainder.errors(readings)
    problem = GreyBoxFit(rival.fit.structure, new, contest.context.scales, errors)
    found = problem.normal_equations(rival.fit.values, rival.fit.free)
    if not math.isfinite(found.cost):
        return 0.0
    tau = contest.remainder.independence
    normal = found.normal / tau + rival.information
    adapted = found.gradient @ np.linalg.pinv(normal, hermitian=True) @ found.gradient / tau
    return max(found.cost - float(adapted), 0.0) / (2.0 * tau)


def worth(contest: Contest, truth: int, readings: Record) -> float:
    """Return the expected logarithm of the odds of a rival, by its index, after a record with its readings, linearized."""
    rivals = contest.rivals
    others = [rival for index, rival in enumerate(rivals) if index != truth]
    left = [math.log(rival.probability) - about(contest, rival, readings) for rival in others]
    return math.log(rivals[truth].probability) - float(np.logaddexp.reduce(left))


@dataclass(frozen=True)
class Refitted:
    """A rival fitted to the old records and a new one together."""

    against: float  # minus the logarithm of the likelihood of the new record, up to a constant common to all rivals
    left: Floats  # of its readings, in units of their errors, shape (n_samples, n_outputs)


def refitted(contest: Contest, rival: Rival, readings: Record, errors: Mapping[str, float]) -> Refitted:
    """Fit a rival again to all records, of which the new one counts in units of its own errors."""
    fit, n_old = rival.fit, len(contest.records)
    new = contest.windowing.cut([readings])
    problem = GreyBoxFit(fit.structure, [*contest.records, *new], contest.context.scales, contest.errors)
    outputs = [signal.name for signal in contest.context.rig.outputs]
    units = np.array([errors.get(name, np.inf) for name in outputs])
    problem.data = _with_errors(problem.data, len(new), units)
    states = guessed_states(problem.data, fit.values)[n_old:]
    found = problem.fit(fit.values, fit.free, initial_states=[*fit.initial_states, *states])
    if not found.residuals:
        return Refitted(math.inf, np.full((readings.n_samples, len(errors)), np.inf))
    against = max(found.cost - fit.cost, 0.0) / (2.0 * contest.remainder.independence)
    return Refitted(against, (np.concatenate(found.residuals[n_old:]) / units)[:, np.isfinite(units)])


def _with_errors(data: FitData, n_new: int, errors: Floats) -> FitData:
    """Return fit data whose last records count in units of these errors of the outputs."""
    scaled = [
        replace(one, weights=np.where(one.weights > 0.0, 1.0 / errors, 0.0)) for one in data.records[-n_new:]
    ]
    return replace(data, records=(*data.records[:-n_new], *scaled))


def posterior(probabilities: Sequence[float], against: Sequence[float]) -> Floats:
    """Return the probabilities of rivals after evidence against each; none exceeds that of a verdict."""
    logs: Floats = np.log(probabilities) - np.array(against)
    if not np.any(np.isfinite(logs)):
        return np.array(probabilities)
    weights = np.exp(logs - np.max(logs))
    shares: Floats = weights / np.sum(weights)
    return np.minimum(shares, MOST)
