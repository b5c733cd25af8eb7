"""The experiment within the limits that separates rivals best: a library, and changes of its best."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.errors import InputError, SimulationError
from rigsight.plan.discrimination import predicted, worth
from rigsight.plan.experiments import SHARES, Bench, Experiment
from rigsight.plan.limits import Limit, use_of
from rigsight.plan.rivals import Truth
from rigsight.records import Record

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
        """Return the experiments of the library and the changed ones, the best first.

        Raises
        ------
        InputError
            If no experiment keeps the limits.
        """
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
