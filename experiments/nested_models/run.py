"""Is chi square ordered as models are nested, and is no effect of size zero named?

    python experiments/nested_models/run.py --seed 1 --draws 50

Each draw is a plant of the coverage study (axis, running gear and drive train in turn) whose hidden effect is drawn from the
catalogue; the given simulation has parameters that are off, and dampings of zero in every other draw. All effects are examined
as in a diagnosis. Draws are kept in ``draws_SEED.jsonl`` and not done again; ``--table`` prints the summary alone.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "coverage"))

from plants import Drawn, drawn  # noqa: E402

from rigsight.campaign import Campaign  # noqa: E402
from rigsight.diagnose import examination  # noqa: E402
from rigsight.diagnose.fit_context import FittedModel, candidates_on  # noqa: E402
from rigsight.diagnose.noise.adequacy import Checks  # noqa: E402
from rigsight.diagnose.policy import VERDICT  # noqa: E402
from rigsight.diagnose.search.evidence_for_more import OtherForms  # noqa: E402
from rigsight.diagnose.search.fitted_models import AllModels  # noqa: E402
from rigsight.effects import CATALOGUE  # noqa: E402
from rigsight.rigs import RIGS, Rig  # noqa: E402

ON = ("axis", "running_gear", "drive_train")
OFF = 0.15
"""Standard deviation of the logarithm of the factor by which given parameters are off."""
LIMITS = {"bouc_wen_hysteresis", "gravity_pendulum", "iwan_hysteresis", "presliding_friction"}
"""Effects that reach their parents in a limit only, such as a stiffness that tends to infinity: chi square may be above these."""
SAMPLES = 1200
"""Of each record: enough for every effect to be fitted, and short, because the order of fits is what is studied."""


def campaign_of(plant: Drawn, rig: Rig, at_bounds: bool, rng: np.random.Generator) -> Campaign:
    """Return the records of a plant, the last for validation, with a given simulation that is off."""
    *fitted, last = (record.slice(0, SAMPLES) for record in plant.bench.estimation)
    records = (*fitted, replace(last, role="validation"))
    given = {
        p.name: plant.values[p.name] * float(np.exp(OFF * rng.standard_normal())) for p in rig.parameters
    }
    dampings = {str(s) for joint in rig.mechanism.joints for s in joint.damping.free_symbols}
    if at_bounds:
        given |= dict.fromkeys(dampings & given.keys(), 0.0)
    constants = {c.name: plant.values[c.name] for c in rig.constants}
    return Campaign("nested", rig, constants, given, records)


def single_effects_only(_campaign, models, lower_bound, _allowed, rng, _say):  # type: ignore[no-untyped-def]
    """Return the models of one effect alone: the order of these is studied, and pairs take ten times as long."""
    most_remainder = np.inf if lower_bound else VERDICT.most_remainder
    checks = Checks(models.context, rng, VERDICT.at_floor, most_remainder)
    return AllModels(models, [], False, checks, OtherForms(models.context, lower_bound))


examination.with_several_effects = single_effects_only


def excess(model: FittedModel, special: FittedModel) -> float:
    """Return by what share of itself chi square of a model is above that of its special case."""
    return model.fit.cost / special.fit.cost - 1.0


def others(model: FittedModel) -> list[str]:
    """Return the free parameters beside those of the effect."""
    own = {model.fit.structure.parameter_name(e, p.name) for e in model.effects for p in e.parameters}
    return [name for name in model.fit.free if name not in own]


def is_limit(pair: str) -> bool:
    """Return True for "effect over parent" where the parent is a limit of the effect."""
    return pair.split(" over ")[0].split("@")[0] in LIMITS


def draw(seed: int, number: int) -> dict[str, Any]:
    """Return what one draw gives."""
    rng = np.random.default_rng([seed, number])
    rig = RIGS[ON[number % len(ON)]]
    hidden = candidates_on(rig, CATALOGUE)
    effect = hidden[int(rng.integers(len(hidden)))]
    begun = time.monotonic()
    campaign = campaign_of(drawn(rig, effect, (seed, number)), rig, number % 2 == 0, rng)
    found = examination.examine(campaign, CATALOGUE, rng, 1, lambda _: None, None, None)
    singles = {m.names[0]: m for m in found.ranking.order if len(m.effects) == 1}
    base = {
        name: excess(model, found.reidentified)
        for name, model in singles.items()
        if set(found.reidentified.fit.free) <= set(model.fit.free)
    }
    named = found.judgement.model
    sizes = {
        name: abs(named.fit.values[name] - p.null) / named.fit.standard_errors[name]
        for own in named.effects
        for p in own.parameters
        if p.null is not None and abs(p.null) < 1e100
        if (name := named.fit.structure.parameter_name(own, p.name)) in named.fit.free
    }
    return {
        "rig": rig.name, "hidden": effect.name, "verdict": found.judgement.verdict, "named": named.names,
        "gap": found.reidentified.error_over_noise, "left": named.error_over_noise,
        "above_equations": {name: value for name, value in base.items() if value > 1e-6}, "compared": len(base),
        "above_parents": {
            f"{name} over {parent}": value
            for name, model in singles.items()
            for parent in model.effects[0].parents
            if parent in singles
            and set(others(singles[parent])) <= set(others(model))
            and (value := excess(model, singles[parent])) > 1e-6
        },
        "size_over_error": sizes if found.judgement.verdict == "effect" else {},
        "seconds": time.monotonic() - begun,
    }  # fmt: skip


def table(lines: list[dict[str, Any]]) -> str:
    """Return the summary."""
    worst = max((v for line in lines for v in line["above_equations"].values()), default=0.0)
    smallest = [max(line["size_over_error"].values()) for line in lines if line["size_over_error"]]
    above = [pair for line in lines for pair in line["above_parents"]]
    return "\n".join(
        [
            f"{len(lines)} draws, {sum(line['compared'] for line in lines)} models compared with the equations",
            f"above them by more than 1e-6: {sum(len(line['above_equations']) for line in lines)} (largest {worst:.2g})",
            f"above an effect that is a special case by more than 1e-6: {sum(not is_limit(p) for p in above)}",
            f"above an effect that is a limit by more than 1e-6: {sum(is_limit(p) for p in above)}",
            f"smallest size of a named effect: {min(smallest, default=np.nan):.3g} standard errors",
            f"hidden effect among the named: {sum(line['hidden'] in line['named'] for line in lines)}",
        ]
    )


def main() -> None:
    """Draw what is missing and print the summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument("--table", action="store_true")
    asked = parser.parse_args()
    path = HERE / f"draws_{asked.seed}.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    for number in range(len(lines), 0 if asked.table else asked.draws):
        lines.append(draw(asked.seed, number))
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(lines[-1]) + "\n")
        print(number, json.dumps(lines[-1]), flush=True)
    print(table(lines))


if __name__ == "__main__":
    main()
