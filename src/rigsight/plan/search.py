"""By how much would a record separate rivals, each fitted again to all records, and which one within the limits does it best?

References
----------
A. C. Atkinson and V. V. Fedorov, Biometrika 62 (1975) 57, for T-optimality: the readings of one model are worth what its best
rival leaves of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.diagnose.policy import FAMILIES
from rigsight.errors import InputError, SimulationError
from rigsight.identify import GreyBoxFit
from rigsight.identify.fit.fit_data import FitData
from rigsight.identify.fit.settled_states import guessed_states
from rigsight.plan.experiments import SHARES, Bench, Experiment, Limit, use_of
from rigsight.plan.rivals import Contest, Rival, Truth
from rigsight.records import Floats, Record
from rigsight.simulate import simulate

_ACCURACY = 1e-4
MOST = 1.0 - FAMILIES.failing
"""Largest probability, as of verdicts: so often the evidence itself fails."""
_CHANGED, _CHANGES = 3, 40
"""Best experiments of the library that are changed, and how often each."""
_AGAIN, _DRAWN = 10, 1
"""Best experiments of the library that are judged again, and drawn sets of numbers of each rival: what separates the rivals with
one set may not with another."""
_WITHIN = 0.98
"""Share of a limit that the largest amplitude uses at most when it is found by steps."""
_STEPS = 12
_SMALLEST = 1e-4
"""Amplitude, in units of the room of the inputs, below which an experiment is given up."""
_RESIZED = (0.6, 1.5)


def predicted(rival: Rival, record: Record) -> Record:
    """Return a record with the readings that a rival predicts from rest."""
    return simulate(rival.fit.structure, rival.fit.values, record, accuracy=_ACCURACY)


def about(contest: Contest, rival: Rival, readings: Record) -> float:
    """Return the expected log likelihood ratio of readings of the right rival against one that is fitted again, linearized."""
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


def refitted(
    contest: Contest,
    rival: Rival,
    readings: Record,
    errors: Mapping[str, float],
    start: Mapping[str, float] | None = None,
) -> Refitted:
    """Fit a rival again to all records, from its own numbers or others; the new record counts in units of its own errors."""
    fit, n_old = rival.fit, len(contest.records)
    new = contest.windowing.cut([readings])
    problem = GreyBoxFit(fit.structure, [*contest.records, *new], contest.context.scales, contest.errors)
    outputs = [signal.name for signal in contest.context.rig.outputs]
    units = np.array([errors.get(name, np.inf) for name in outputs])
    problem.data = _with_errors(problem.data, len(new), units)
    values = fit.values if start is None else start
    states = guessed_states(problem.data, values)[n_old:]
    found = problem.fit(values, fit.free, initial_states=[*fit.initial_states, *states])
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


@dataclass(frozen=True, eq=False)
class Scored:
    """An experiment within the limits, with its worth."""

    experiment: Experiment
    readings: Record  # that the most probable model predicts
    worth: float  # expected logarithm of the odds afterwards, linearized, a mean over rivals as the truth and their numbers


class Search:
    """Scores experiments whose simulations of all rivals keep the limits."""

    def __init__(self, truths: Sequence[Truth], bench: Bench, limits: Sequence[Limit]) -> None:
        self._bench, self._limits = bench, limits
        self._truths, self._judged = truths, list(truths)

    def best(
        self, constants: Sequence[Mapping[str, float]], rng: np.random.Generator, say: Callable[[str], None]
    ) -> list[Scored]:
        """Return the experiments of the library and the changed ones that keep the limits, the best first."""
        found: list[Scored] = []
        for experiment in self._bench.library(constants, rng):
            largest = self._largest(experiment)
            if largest is not None:
                tried = [largest.with_amplitude(share * largest.amplitude) for share in SHARES]
                found += [scored for scored in map(self.scored, tried) if scored is not None]
            say(experiment.what)
        if not found:
            raise InputError(
                f"No experiment keeps the limits ({', '.join(f'{m.name} = {m.value:g}' for m in self._limits)}): "
                "the models exceed one of them even at rest, or with the smallest inputs. Give larger limits."
            )
        found.sort(key=lambda scored: -scored.worth)
        self._judged += [truth.drawn(rng) for truth in self._truths for _ in range(_DRAWN)]
        again = [self.scored(scored.experiment) for scored in found[:_AGAIN]]
        found = [scored for scored in again if scored is not None] or found
        found.sort(key=lambda scored: -scored.worth)
        better = []
        for scored in found[:_CHANGED]:
            better.append(self._improved(scored, rng))
            say("changed phases and amplitudes")
        return sorted([*better, *found], key=lambda scored: -scored.worth)

    def scored(self, experiment: Experiment) -> Scored | None:
        """Return an experiment with its worth; None if a model exceeds the limits or cannot be simulated."""
        record = self._bench.record(experiment)
        try:
            readings = predicted(self._truths[0].rival, record)
            if self._use(experiment) > 1.0:
                return None
            each = [
                worth(truth.contest, truth.index, predicted(truth.rival, record)) for truth in self._judged
            ]
            weights = [truth.weight for truth in self._judged]
            # A concave mean: to decide whichever is true counts more than to decide still more surely in one case.
            return Scored(experiment, readings, float(np.sinh(np.average(np.arcsinh(each), weights=weights))))
        except SimulationError:
            return None

    def _use(self, experiment: Experiment) -> float:
        """Return the largest share of a limit that any of the models uses."""
        record = self._bench.record(experiment)
        return max(use_of(self._limits, predicted(truth.rival, record)) for truth in self._truths)

    def _largest(self, experiment: Experiment) -> Experiment | None:
        """Return an experiment with about the largest amplitude that keeps the limits."""
        tried = experiment
        for _ in range(_STEPS):
            try:
                use = self._use(tried)
            except SimulationError:
                use = 2.0
            if use <= 1.0:
                return tried
            tried = tried.with_amplitude(tried.amplitude * min(_WITHIN / use, _WITHIN))
            if tried.amplitude < _SMALLEST:
                break
        return None

    def _improved(self, scored: Scored, rng: np.random.Generator) -> Scored:
        for number in range(_CHANGES):
            experiment = scored.experiment
            if number % 4 == 3:
                factor = rng.uniform(*_RESIZED)
                tried = experiment.with_amplitude(min(factor * experiment.amplitude, 1.0))
            else:
                tried = self._bench.changed(experiment, rng)
            within = self._largest(tried)
            better = None if within is None else self.scored(within)
            if better is not None and better.worth > scored.worth:
                scored = better
        return scored
