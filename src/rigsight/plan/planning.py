"""The plan: the experiment, what each rival predicts, what probability to expect afterwards, and whether simulations keep it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from rigsight.campaign import Campaign
from rigsight.errors import InputError, SimulationError
from rigsight.json_data import json_data
from rigsight.plan.experiments import Bench, Limit, with_recorded_range
from rigsight.plan.rivals import Named, Truth, contest_of
from rigsight.plan.search import Scored, Search, posterior, predicted, refitted
from rigsight.plan.usual_sizes import truths_of_usual_size
from rigsight.records import Floats, Record

SCHEMA_VERSION = 1
Sizes = Literal["fitted", "usual", "usual, no records"]
"""Sizes of the rivals: fitted to the records; usual ones beside the records; or usual ones before there are any."""
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
    probability: float  # before, if it is the truth
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
    """An experiment to be played."""

    # Of the campaign.
    title: str
    rig: str
    sizes: Sizes  # whether the rivals were fitted to the records or are of a usual size
    what: str  # the experiment in words
    record: Record  # its inputs, with the constants of the rig that it needs
    limits: tuple[tuple[Limit, float], ...]  # with the largest value in the simulations of all rivals
    rivals: tuple[Prediction, ...]  # most probable first
    errors: Mapping[str, float]  # error to be expected of each output
    now: float  # expected probability of the truth before
    without_noise: float  # the same afterwards for the numbers so far and readings without noise
    trials: Trials  # the simulated outcomes
    others: tuple[Scored, ...]  # further experiments with their linearized worth

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
            "sizes": self.sizes,
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
            "probability_now": self.now,
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
    *,
    sizes: Sizes = "fitted",
    payloads: Sequence[Mapping[str, float]] = (),
) -> Plan:
    """Return the experiment of so many seconds that separates rivals best within limits that hold in the simulations of all."""
    # Payloads are values that constants of the rig may have in the experiment, beside those of the records; `draws` outcomes are
    # simulated for each rival as the truth.
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
    if sizes == "fitted":
        contest = contest_of(campaign, named, say)
        truths = [Truth(contest, rival, rival.probability) for rival in contest.rivals]
    else:
        truths = truths_of_usual_size(campaign, named, n_samples, sizes == "usual", say)
    first = truths[0].contest
    bench = Bench.of(rig, campaign.estimation, kept, n_samples, 1.0 / first.context.scales["time"])
    search = Search(truths, bench, kept).best(_constants(campaign, payloads), rng, say)
    chosen = search[0]
    errors = first.remainder.errors(chosen.readings)
    again = {rival.label: refitted(first, rival, chosen.readings, errors) for rival in first.rivals}
    best = again[truths[0].rival.label]
    say("fitted again")
    readings = [predicted(truth.rival, bench.record(chosen.experiment)) for truth in truths]
    trials, without_noise = _simulated(truths, readings, draws, rng, say)
    predictions = []
    for truth, shown in zip(truths, readings, strict=True):
        rival = truth.rival
        own, values = again[rival.label], {name: rival.fit.values[name] for name in rival.fit.free}
        rms, before = float(np.sqrt(np.nanmean(own.left**2))), truth.contest.rivals[truth.index].probability
        evidence = own.against - best.against
        predictions.append(Prediction(rival.label, before, values, shown, own.left, rms, evidence))
    kinds: dict[str, Scored] = {}
    for scored in search:
        kinds.setdefault(scored.experiment.what, scored)
    return Plan(
        campaign.title,
        rig.name,
        sizes,
        chosen.experiment.what,
        bench.record(chosen.experiment),
        tuple((limit, max(limit.reached(one) for one in readings)) for limit in kept),
        tuple(predictions),
        errors,
        sum(truth.weight * one.probability for truth, one in zip(truths, predictions, strict=True)),
        without_noise,
        trials,
        tuple(kinds.values())[:_LISTED],
    )


def _constants(campaign: Campaign, payloads: Sequence[Mapping[str, float]]) -> list[Mapping[str, float]]:
    """Return the sets of constants that are tried: those of the records, each with every payload as well."""
    recorded = {tuple(sorted(r.constants.items())): r.constants for r in campaign.estimation}
    return [{**own, **payload} for payload in ({}, *payloads) for own in recorded.values()]


def _simulated(
    truths: Sequence[Truth],
    readings: Sequence[Record],
    draws: int,
    rng: np.random.Generator,
    say: Callable[[str], None],
) -> tuple[Trials, float]:
    """Return the outcomes of simulated experiments, and the probability of the truth that is expected without noise."""
    right, decided, wrong, expected, without_noise = np.zeros(5)
    for truth, shown in zip(truths, readings, strict=True):
        weight, index = truth.weight, truth.index
        without_noise += weight * _outcome(truth, shown, shown)[index]
        for _ in range(draws):
            drawn = truth.drawn(rng)
            try:
                clean = predicted(drawn.rival, shown)
            except SimulationError:
                # Drawn numbers that cannot be simulated are not drawn.
                drawn, clean = truth, shown
            found = _outcome(drawn, _with_noise(drawn, clean, rng), clean)
            right += weight / draws * (int(np.argmax(found)) == index)
            expected += weight / draws * found[index]
            decided += weight / draws * (found[index] >= DECIDED)
            wrong += weight / draws * (np.max(np.delete(found, index)) >= DECIDED)
            say("simulated outcome")
    trials = Trials(draws * len(readings), *map(float, (expected, right, decided, wrong)))
    return trials, float(without_noise)


def _outcome(truth: Truth, record: Record, clean: Record) -> Floats:
    """Return the probabilities of the rivals after a record, whose errors are those of its readings without noise."""
    contest = truth.contest
    errors = contest.remainder.errors(clean)
    against = [refitted(contest, rival, record, errors).against for rival in contest.rivals]
    index = truth.index
    if truth.rival is not contest.rivals[index]:
        # Where a joint sticks the cost has many minima; that of drawn numbers is near them.
        near = refitted(contest, contest.rivals[index], record, errors, truth.rival.fit.values)
        against[index] = min(against[index], near.against)
    return posterior([rival.probability for rival in contest.rivals], against)


def _with_noise(truth: Truth, clean: Record, rng: np.random.Generator) -> Record:
    """Return readings with drawn errors."""
    remainder = truth.contest.remainder
    names = [signal.name for signal in truth.contest.context.rig.outputs]
    errors, noise = remainder.errors(clean), remainder.drawn(clean.n_samples, rng)
    noisy = {
        name: clean[name] + error * noise[:, names.index(name)]
        for name, error in errors.items()
        if name in clean
    }
    return clean.with_signals(**noisy)
