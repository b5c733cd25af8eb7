"""By how much would a record separate rivals, each fitted again to all records?

References
----------
A. C. Atkinson and V. V. Fedorov, Biometrika 62 (1975) 57, for T-optimality: the readings of one model are worth what its best
rival leaves of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

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
    (record,) = contest.windowing.cut([readings]) if contest.windowing.length is None else (readings,)
    problem = GreyBoxFit(
        rival.fit.structure, [record], contest.context.scales, contest.remainder.errors(readings)
    )
    found = problem.normal_equations(rival.fit.values, rival.fit.free)
    if not math.isfinite(found.cost):
        return 0.0
    normal = found.normal + rival.information
    adapted = found.gradient @ np.linalg.pinv(normal, hermitian=True) @ found.gradient
    return max(found.cost - float(adapted), 0.0) / (2.0 * contest.remainder.independence)


def worth(contest: Contest, readings: Record) -> float:
    """Return the expected logarithm of the odds of the most probable model after a record with its readings, linearized."""
    others = contest.rivals[1:]
    left = [math.log(rival.probability) - about(contest, rival, readings) for rival in others]
    return math.log(contest.best.probability) - float(np.logaddexp.reduce(left))


class Refits:
    """Fits of all rivals to the old records and a new one together."""

    def __init__(self, contest: Contest) -> None:
        self._contest = contest

    def evidence_against(self, rival: Rival, readings: Record, errors: Mapping[str, float]) -> float:
        """Return minus the logarithm of the likelihood of new readings for a rival, up to a constant common to all rivals."""
        cost = self.fitted(rival, readings, errors)[0]
        return max(cost - rival.fit.cost, 0.0) / (2.0 * self._contest.remainder.independence)

    def fitted(self, rival: Rival, readings: Record, errors: Mapping[str, float]) -> tuple[float, Floats]:
        """Return the sum of squares of all records, and what is left of the new one, shape (n_samples, n_outputs)."""
        contest, fit = self._contest, rival.fit
        new = contest.windowing.cut([readings])
        problem = GreyBoxFit(fit.structure, [*contest.records, *new], contest.context.scales, contest.errors)
        problem.data = _with_errors(problem.data, len(new), [s.name for s in contest.context.rig.outputs], errors)
        states = guessed_states(problem.data, fit.values)[len(contest.records) :]
        found = problem.fit(fit.values, fit.free, initial_states=[*fit.initial_states, *states])
        if not found.residuals:
            return math.inf, np.zeros((0, 0))
        return found.cost, np.concatenate(found.residuals[len(contest.records) :])


def _with_errors(data: FitData, n_new: int, outputs: Sequence[str], errors: Mapping[str, float]) -> FitData:
    """Return fit data whose last records count in units of their own errors."""
    scaled = [
        replace(
            one,
            weights=np.array(
                [1.0 / errors[name] if weight > 0.0 else 0.0 for name, weight in zip(outputs, one.weights, strict=True)]
            ),
        )
        for one in data.records[-n_new:]
    ]
    return replace(data, records=(*data.records[:-n_new], *scaled))


def posterior(probabilities: Sequence[float], against: Sequence[float]) -> Floats:
    """Return the probabilities of rivals after evidence against each; none exceeds that of a verdict."""
    logs = np.log(probabilities) - np.array(against)
    if not np.any(np.isfinite(logs)):
        return np.array(probabilities)
    weights = np.exp(logs - np.max(logs))
    return np.minimum(weights / np.sum(weights), MOST)

