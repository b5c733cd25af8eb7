"""Are effects that the matrix calls separable told apart in blind trials, and those that it calls inseparable not?

Trials of one hidden effect are drawn by the bench, each on a rig of its own. From the matrix of their records some rivals of the
hidden effect are drawn, and the diagnosis has two candidates: it and the rival.

Usage: python experiments/matrix/run.py SEED FIRST LAST OUT.jsonl [ANSWER ...]; without answers all are drawn.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from rigsight.campaign import Campaign
from rigsight.check import Check
from rigsight.effects import CATALOGUE, Effect
from rigsight.inverse import with_all_inputs
from rigsight.workflow.check import check_of
from rigsight.workflow.diagnose import diagnose_campaign
from rigsight.workflow.own.own_effects import candidates_of
from rigsight_bench.trials.designs import draw_trial
from rigsight_bench.trials.trial import Trial

PER_ANSWER = 3
"""Rivals of each trial for each answer of the matrix."""
ANSWERS = ("apart", "by size", "other motion", "alike")


def rivals(
    found: Check, hidden: str, answers: Sequence[str], rng: np.random.Generator
) -> Iterator[tuple[str, str]]:
    """Yield some rivals of an effect, each with the answer of the matrix."""
    names = found.matrix.effects
    row = found.matrix.told[names.index(hidden)]
    for answer in answers:
        those = [name for name, told in zip(names, row, strict=True) if told == answer and name != hidden]
        for rival in rng.permutation(those)[:PER_ANSWER]:
            yield str(rival), answer


def judged(trial: Trial, seed: int, number: int, answers: Sequence[str]) -> Iterator[dict[str, object]]:
    """Yield each pair of a trial with the answer of the matrix and which of the two the diagnosis puts first."""
    hidden = list(trial.key["effects"])
    if len(hidden) != 1 or trial.modelled:
        return
    constants = {p.name: trial.values[p.name] for p in trial.rig.constants}
    records = tuple(with_all_inputs(trial.rig, record) for record in trial.records)
    campaign = Campaign(f"trial {number}", trial.rig, constants, trial.given, records)
    candidates: dict[str, Effect] = {e.name: e for e in candidates_of(campaign, CATALOGUE)}
    found = check_of(campaign)
    if hidden[0] not in found.matrix.effects:
        return
    visible = found.matrix.visible[found.matrix.effects.index(hidden[0])]
    for rival, answer in rivals(found, hidden[0], answers, np.random.default_rng([seed, number])):
        diagnosis = diagnose_campaign(campaign, [candidates[hidden[0]], candidates[rival]], seed=0)
        alone = [candidate.effects for candidate in diagnosis.candidates if len(candidate.effects) == 1]
        first = alone[0] if alone else ()
        yield {
            "trial": number,
            "rig": campaign.rig.name,
            "hidden": hidden[0],
            "rival": rival,
            "answer": answer,
            "visible": visible,
            "first": list(first),
            "right": list(first) == hidden,
        }


def main(seed: int, first: int, last: int, out: Path, answers: Sequence[str]) -> None:
    """Judge the trials of a range and write a line for each pair."""
    for number in range(first, last):
        for design in ("standard", "laboratory"):
            trial = draw_trial(design, seed, number)
            with out.open("a", encoding="utf-8") as file:
                for line in judged(trial, seed, number, answers):
                    file.write(json.dumps({"design": design, **line}) + "\n")
                    file.flush()


if __name__ == "__main__":
    seed, first, last = map(int, sys.argv[1:4])
    main(seed, first, last, Path(sys.argv[4]), sys.argv[5:] or ANSWERS)
