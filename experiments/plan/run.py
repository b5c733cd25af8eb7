"""Does one planned record decide between rivals that one record leaves open, and does a plan keep its promise?

An axis, a hidden effect and its size are drawn by the functions of the blind bench. One short record is measured: a sweep through
the resonance, a wide one, or a multisine. A rival of another family is drawn until the record leaves less than 20 to 1 between it
and the hidden effect. Then one more record is measured on the true axis: as planned, as the report advises, or the first one once
more. All are equally long; the plan keeps to the inputs of the first record, as the advice does, and to the stroke of both; a
further one may use three times as much, as a user may allow, and the inputs of the advice are played three times as large, too.

Usage: python experiments/plan/run.py SEED FIRST LAST OUT.jsonl
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.advise import Advice, advise
from rigsight.diagnose.fit_context import FittedModel
from rigsight.effects import Effect, effect_named
from rigsight.errors import RigsightError
from rigsight.excitation import linear_sweep, multisine, multisine_lines, step
from rigsight.identify import characteristic_scales
from rigsight.plan import Limit, Named
from rigsight.plan.planning import plan_experiment
from rigsight.plan.rivals import Contest, contest_of
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate
from rigsight.workflow.own.own_effects import candidates_of
from rigsight_bench.trials.standard.campaign import draw_rig
from rigsight_bench.trials.strength import draw_shape, scaled, sized

ODDS = 20.0
MOST_RIVALS = 10
"""Rivals that are tried for each trial."""
DT, SECONDS = 0.01, 10.0
WIDER = 3.0
"""What a user may allow, in units of what the records contain, which today's advice does not leave."""
AMPLITUDES = (0.1, 0.6)
SIZES = (0.5, 2.0)
"""What a hidden effect adds to the readings of the first record, in units of the noise."""
NOISES = (1e-3, 1e-2)
"""Noise in units of the readings."""
EFFECTS = (
    "coulomb_friction",
    "stribeck_friction",
    "quadratic_damping",
    "position_dependent_damping",
    "cubic_stiffness",
    "power_law_stiffness",
    "asymmetric_stiffness",
    "end_stop",
    "free_play",
    "backlash",
    "bouc_wen_hysteresis",
    "maxwell_branch",
    "input_saturation",
    "input_dead_zone",
    "input_delay",
    "actuator_lag",
    "sensor_lag",
    "gravity_pendulum",
)


@dataclass(frozen=True)
class Truth:
    """A drawn axis with its hidden effect, and the first record of it."""

    hidden: Effect
    values: Mapping[str, float]
    noise: float
    first: Record

    def measured(self, record: Record, rng: np.random.Generator) -> Record:
        """Return the readings of the axis with noise."""
        run = simulate(compose(AXIS, [self.hidden]), self.values, record)
        return run.with_signals(x=run["x"] + rng.normal(scale=self.noise, size=run.n_samples))

    @property
    def campaign(self) -> Campaign:
        """The first record with the numbers of the axis, as they are."""
        given = {p.name: self.values[p.name] for p in AXIS.parameters}
        return Campaign("trial", AXIS, {"gain": self.values["gain"]}, given, (self.first,))


def drawn(rng: np.random.Generator) -> Truth:
    """Draw an axis, an effect, its size and the first record."""
    linear = draw_rig(rng, AXIS, swings_wide=False)
    hidden = effect_named(str(rng.choice(EFFECTS)))
    t, omega = DT * np.arange(round(SECONDS / DT)), linear.omega
    waves = (
        linear_sweep(t, 1.0, 0.7 * omega, 1.3 * omega),
        linear_sweep(t, 1.0, 0.1 * omega, 3.0 * omega),
        multisine(t.size, DT, multisine_lines(t.size, DT, 0.3 * omega, 2.0 * omega), 0.3, rng).samples,
    )
    u = rng.uniform(*AMPLITUDES) * waves[int(rng.integers(len(waves)))]
    record = Record("first", DT, {"u": u}, {"u": "N", "x": "m"})
    alone = simulate(compose(AXIS), linear.values, record)
    noise = float(np.std(alone["x"])) * np.exp(rng.uniform(*np.log(NOISES)))
    scales = characteristic_scales(AXIS, [alone], linear.values)
    shape, structure = draw_shape(hidden, scales, rng), compose(AXIS, [hidden])

    def values(own: Mapping[str, float]) -> dict[str, float]:
        return {**linear.values, **{structure.parameter_name(hidden, name): v for name, v in own.items()}}

    def added(own: dict[str, float]) -> float:
        return float(np.std(simulate(structure, values(own), record)["x"] - alone["x"])) / noise

    wished = float(np.hypot(1.0, np.exp(rng.uniform(*np.log(SIZES)))))
    found = sized(hidden.name, lambda s: scaled(hidden, shape, s, scales), added, wished, least=0.0)
    truth = Truth(hidden, values(found.values), noise, record)
    return replace(truth, first=truth.measured(record, rng))


def probability(contest: Contest, hidden: str) -> float:
    """Return the probability of the hidden effect."""
    return next(rival.probability for rival in contest.rivals if rival.label == hidden)


def undecided(
    campaign: Campaign, hidden: Effect, others: Sequence[Effect], rng: np.random.Generator
) -> tuple[Effect, Contest] | None:
    """Return a rival of another family that the record does not exclude, and the two fitted."""
    families = [effect for effect in others if effect.family != hidden.family]
    for index in rng.permutation(len(families))[:MOST_RIVALS]:
        rival = families[int(index)]
        try:
            contest = contest_of(campaign, [Named((hidden,)), Named((rival,))], lambda _: None)
        except RigsightError:
            continue
        if 1.0 / (1.0 + ODDS) < probability(contest, hidden.name) < ODDS / (1.0 + ODDS):
            return rival, contest
    return None


def advised(contest: Contest, campaign: Campaign) -> Record:
    """Return the inputs of the experiment that the report advises, as long as the first record."""
    context = replace(contest.context, estimation=campaign.estimation)
    models = [FittedModel(rival.fit.structure.effects, rival.fit, rival.fit, 1.0) for rival in contest.rivals]
    (found,) = advise(context, models[0], models[1:], context.noise)
    like = campaign.estimation[0]
    u = float(np.median(like["u"])) + waveform(found, like.t)
    return Record("advised", like.dt, {"u": u}, like.units, hold=like.hold)


def waveform(found: Advice, t: np.ndarray) -> np.ndarray:
    """Return the samples that an advice means."""
    if found.band is None:
        return step(t, found.amplitude, 0.1 * float(t[-1]))
    if found.waveform == "sweep":
        return linear_sweep(t, found.amplitude, *found.band)
    return found.amplitude * np.sin(found.band[0] * t)


def judged(number: int, rng: np.random.Generator) -> Iterator[dict[str, object]]:
    """Yield the outcome of a trial that the first record leaves open."""
    truth = drawn(rng)
    campaign, hidden, first = truth.campaign, truth.hidden, truth.first
    found = undecided(campaign, hidden, candidates_of(campaign, list(map(effect_named, EFFECTS))), rng)
    if found is None:
        return
    rival, contest = found
    by_menu = advised(contest, campaign)
    shown = simulate(contest.rivals[0].fit.structure, contest.rivals[0].fit.values, by_menu)
    stroke = max(Limit("x", 1.0).reached(record) for record in (first, shown))
    pair = [Named((hidden,)), Named((rival,))]
    seed = int(rng.integers(2**31))
    plan = plan_experiment(campaign, pair, [Limit("x", stroke)], SECONDS, seed, lambda _: None)
    wider = [Limit("x", WIDER * stroke), Limit("u", WIDER * Limit("u", 1.0).reached(first))]
    wide = plan_experiment(campaign, pair, wider, SECONDS, seed, lambda _: None)
    outcome: dict[str, object] = {
        "trial": number,
        "hidden": hidden.name,
        "rival": rival.name,
        "before": probability(contest, hidden.name),
        "experiment": plan.what,
        "without_noise": plan.without_noise,
        "promised": plan.promised,
        "wide_promised": wide.promised,
        "wide_experiment": wide.what,
        "simulated_right": plan.trials.right,
        "simulated_decided": plan.trials.decided,
        "simulated_wrong": plan.trials.wrong,
    }
    # The numbers before are one of the starts of the fits after, in all three cases.
    values = {one.label: one.fit.values for one in contest.rivals}
    known = [replace(one, values=values[one.label]) for one in pair]
    for what, record in (
        ("plan", plan.record),
        ("wide", wide.record),
        ("menu", by_menu),
        ("repetition", first),
        ("wide_menu", by_menu.with_signals(u=WIDER * by_menu["u"])),
    ):
        new = replace(truth.measured(record, rng), name=what)
        after = contest_of(replace(campaign, records=(first, new)), known, lambda _: None)
        outcome[what] = probability(after, hidden.name)
    yield outcome


def main(seed: int, first: int, last: int, out: Path) -> None:
    """Judge the trials of a range and write a line for each that is undecided."""
    for number in range(first, last):
        try:
            lines = list(judged(number, np.random.default_rng([seed, number])))
        except RigsightError as error:
            lines = [{"trial": number, "failed": str(error)}]
        with out.open("a", encoding="utf-8") as file:
            for line in lines:
                file.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
