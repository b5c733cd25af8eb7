"""The plan: the experiment, what each rival predicts, what probability to expect afterwards, and whether simulations keep it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigsight.campaign import Campaign
from rigsight.errors import InputError, SimulationError
from rigsight.json_data import json_data
from rigsight.plan.discrimination import posterior, predicted, refitted
from rigsight.plan.experiments import Bench
from rigsight.plan.limits import Limit, with_recorded_range
from rigsight.plan.rivals import Contest, Named, Rival, contest_of
from rigsight.plan.search import Scored, Search
from rigsight.records import Record
from rigsight.records.record import Floats

SCHEMA_VERSION = 1
DRAWS = 6
"""Simulated outcomes for each rival as the truth."""
_FEWEST, _MOST = 500, 100_000
_LISTED = 5
DECIDED = 0.95
"""Probability from which rivals count as decided: odds of 20 to 1, nearly."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a rival says of the experiment."""

    effects: str
    probability: float  # before
    values: Mapping[str, float]  # of its free numbers
    readings: Record  # with the numbers before
    # Of the readings of the most probable model once it is fitted again, in units of the errors, shape (n_samples, n_outputs).
    left: Floats
    rms_left: float
    evidence: float  # expected logarithm of the likelihood ratio then


@dataclass(frozen=True)
class Trials:
    """Simulated outcomes: each rival in turn is the truth, its numbers and noise are drawn, and all are fitted again."""

    n: int
    expected: float  # mean probability of the truth
    right: float  # share in which the truth is the most probable, each rival as often as it is probable
    decided: float  # share in which it reaches `DECIDED`
    wrong: float  # share in which another one does


@dataclass(frozen=True, eq=False)
class Plan:
    """An experiment to be played.

    Attributes
    ----------
    title, rig
        Of the campaign.
    what
        The experiment in words.
    record
        Its inputs, with the constants of the rig that it needs.
    limits
        With the largest value in the simulations of all rivals.
    rivals
        Most probable first.
    errors
        Error to be expected of each output.
    without_noise
        Expected probability of the truth afterwards for the numbers so far and readings without noise.
    trials
        The simulated outcomes.
    others
        Further experiments with their linearized worth.
    """

    title: str
    rig: str
    what: str
    record: Record
    limits: tuple[tuple[Limit, float], ...]
    rivals: tuple[Prediction, ...]
    errors: Mapping[str, float]
    without_noise: float
    trials: Trials
    others: tuple[Scored, ...]

    @property
    def promised(self) -> float:
        """Probability of the truth to be expected afterwards: no more than simulations keep."""
        return min(self.without_noise, self.trials.expected)

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``plan.json``."""
        content = {
            "schema_version": SCHEMA_VERSION,
            "title": self.title,
            "rig": self.rig,
            "experiment": self.what,
            "dt": self.record.dt,
            "n_samples": self.record.n_samples,
            "hold": self.record.hold,
            "constants": dict(self.record.constants),
            "limits": [
                {"signal": limit.name, "limit": limit.value, "largest": largest}
                for limit, largest in self.limits
            ],
            "rivals": [
                {
                    "effects": one.effects,
                    "probability": one.probability,
                    "values": one.values,
                    "rms_left": one.rms_left,
                    "log_likelihood_ratio": one.evidence,
                }
                for one in self.rivals
            ],
            "error": self.errors,
            "probability_now": self.rivals[0].probability,
            "probability_expected": self.promised,
            "probability_without_noise": self.without_noise,
            "simulated": vars(self.trials),
            "other_experiments": [
                {"experiment": s.experiment.what, "amplitude": s.experiment.amplitude, "log_odds": s.worth}
                for s in self.others
            ],
        }
        return dict(json_data(content))


def plan_experiment(
    campaign: Campaign,
    named: Sequence[Named],
    limits: Sequence[Limit],
    seconds: float,
    seed: int,
    say: Callable[[str], None],
    draws: int = DRAWS,
) -> Plan:
    """Return the experiment that separates rivals best.

    Parameters
    ----------
    campaign
        With the records so far.
    named
        At least two rivals.
    limits
        To be kept in the simulations of all rivals.
    seconds
        Duration of the experiment.
    seed
        Seed of drawn phases and noise.
    say
        Called with what has been done.
    draws
        Simulated outcomes for each rival as the truth.

    Raises
    ------
    InputError
        If the rig has no input, or no experiment keeps the limits.
    SimulationError
        If a rival cannot be simulated near the records.
    """
    rig, dt = campaign.rig, campaign.estimation[0].dt
    if not rig.inputs:
        raise InputError(f"{rig.name} has no input, so there is nothing to plan.")
    if not _FEWEST * dt <= seconds <= _MOST * dt:
        raise InputError(
            f"--seconds must give {_FEWEST} to {_MOST} samples at the campaign's sample time of {dt:g} s: "
            f"{_FEWEST * dt:g} to {_MOST * dt:g} s, got {seconds:g}."
        )
    n_samples, rng = round(seconds / dt), np.random.default_rng(seed)
    kept = with_recorded_range(limits, rig, campaign.records)
    contest = contest_of(campaign, named, say)
    bench = Bench.of(rig, campaign.estimation, kept, n_samples, 1.0 / contest.context.scales["time"])
    constants = list({tuple(sorted(r.constants.items())): r.constants for r in campaign.estimation}.values())
    search = Search(contest, bench, kept).best(constants, rng, say)
    chosen = search[0]
    errors = contest.remainder.errors(chosen.readings)
    again = [refitted(contest, rival, chosen.readings, errors) for rival in contest.rivals]
    say("fitted again")
    readings = [predicted(rival, bench.record(chosen.experiment)) for rival in contest.rivals]
    trials, without_noise = _simulated(contest, readings, draws, rng, say)
    return Plan(
        campaign.title,
        rig.name,
        chosen.experiment.what,
        bench.record(chosen.experiment),
        tuple((limit, max(limit.reached(one) for one in readings)) for limit in kept),
        tuple(
            Prediction(
                rival.label,
                rival.probability,
                {name: rival.fit.values[name] for name in rival.fit.free},
                shown,
                own.left,
                float(np.sqrt(np.nanmean(own.left**2))),
                own.against - again[0].against,
            )
            for rival, shown, own in zip(contest.rivals, readings, again, strict=True)
        ),
        errors,
        without_noise,
        trials,
        _different(search),
    )


def _simulated(
    contest: Contest,
    readings: Sequence[Record],
    draws: int,
    rng: np.random.Generator,
    say: Callable[[str], None],
) -> tuple[Trials, float]:
    """Return the outcomes of simulated experiments, and the probability of the truth that is expected without noise."""
    probabilities = [rival.probability for rival in contest.rivals]
    names = list(contest.remainder.floors)
    columns = [[s.name for s in contest.context.rig.outputs].index(name) for name in names]
    right, decided, wrong, expected, without_noise = np.zeros(5)
    for truth, (weight, shown) in enumerate(zip(probabilities, readings, strict=True)):

        def outcome(record: Record, clean: Record) -> Floats:
            errors = contest.remainder.errors(clean)
            return posterior(
                probabilities, [refitted(contest, rival, record, errors).against for rival in contest.rivals]
            )

        without_noise += weight * outcome(shown, shown)[truth]
        for _ in range(draws):
            clean = _drawn_readings(contest, contest.rivals[truth], shown, rng)
            errors, noise = contest.remainder.errors(clean), contest.remainder.drawn(shown.n_samples, rng)
            noisy = {
                name: clean[name] + errors[name] * noise[:, i]
                for name, i in zip(names, columns, strict=True)
                if name in clean
            }
            found = outcome(clean.with_signals(**noisy), clean)
            right += weight / draws * (int(np.argmax(found)) == truth)
            expected += weight / draws * found[truth]
            decided += weight / draws * (found[truth] >= DECIDED)
            wrong += weight / draws * (np.max(np.delete(found, truth)) >= DECIDED)
            say("simulated outcome")
    trials = Trials(draws * len(readings), *map(float, (expected, right, decided, wrong)))
    return trials, float(without_noise)


def _drawn_readings(contest: Contest, rival: Rival, shown: Record, rng: np.random.Generator) -> Record:
    """Return the readings that a rival predicts with drawn numbers; those with its own numbers where they cannot be simulated."""
    try:
        return predicted(rival.drawn(contest.context.scales, rng), shown)
    except SimulationError:
        return shown


def _different(search: Sequence[Scored]) -> tuple[Scored, ...]:
    """Return the best experiment of each kind."""
    kinds: dict[str, Scored] = {}
    for scored in search:
        kinds.setdefault(scored.experiment.what, scored)
    return tuple(kinds.values())[:_LISTED]
