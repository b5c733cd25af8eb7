"""Ask the motion for known causes in measured records, before any fit: run.py FOLDER [--seed 1] [--trials 110].

A trial of `rigsight blind --design measured FOLDER` is drawn, and `rigsight.inverse.propose` is asked which family is missing.
Each is one line of ``trials_SEED.jsonl``; those that are there are not drawn again.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, effect_named
from rigsight.errors import SimulationError
from rigsight.inverse import propose
from rigsight_bench.trials.measured.trial import draw_measured_trial

HERE = Path(__file__).parent


def main() -> None:
    """Draw, ask, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--trials", type=int, default=110)
    arguments = parser.parse_args()
    target = HERE / f"trials_{arguments.seed}.jsonl"
    lines = target.read_text("utf-8").splitlines() if target.exists() else []
    done = {json.loads(line)["trial"] for line in lines}
    with target.open("a", encoding="utf-8") as file:
        for number in sorted(set(range(arguments.trials)) - done):
            found = asked(arguments.folder, arguments.seed, number)
            if found is not None:
                file.write(json.dumps(found) + "\n")
                file.flush()
                print(number, found["campaign"], found["effect"], found["alone"][:2])


def asked(folder: Path, seed: int, number: int) -> dict[str, object] | None:
    """Return what a trial hides and what the motion says; None for one that cannot be drawn or asked."""
    try:
        trial = draw_measured_trial(folder, seed, number)
    except SimulationError:
        return None
    modelled = tuple(effect_named(name) for name in trial.modelled)
    constants = {p.name: trial.values[p.name] for p in trial.rig.constants if p.name in trial.values}
    campaign = Campaign("", trial.rig, constants, trial.given, trial.records, modelled)
    candidates = candidates_on(trial.rig, CATALOGUE, modelled)
    proposal = propose(campaign, {**constants, **trial.given}, candidates)
    if proposal is None:
        return None
    return {
        "trial": number,
        "campaign": trial.key["campaign"],
        "effect": trial.key["effects"][0],
        "family": trial.key["family"],
        "where": trial.key["where"][0],
        "strength": round(trial.key["strength"], 3),
        "alone": [[cause.family, cause.where, round(cause.share, 4)] for cause in proposal.alone],
        "taken": [[cause.family, cause.where, round(cause.share, 4)] for cause in proposal.taken],
        "by_chance": round(proposal.by_chance, 4),
    }


if __name__ == "__main__":
    main()
