"""What the trials of `run.py` show, as tables for the page.

Usage: python experiments/plan/table.py OUT.jsonl
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

ARMS = ("plan", "menu", "repetition", "wide", "wide_menu")
DECIDED = 20.0 / 21.0
"""Odds of 20 to 1."""
BINS = ((0.0, 0.6), (0.6, 0.9), (0.9, 0.96), (0.96, 1.0))


def main(file: Path) -> None:
    """Print the tables."""
    lines = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    trials = [line for line in lines if "plan" in line]
    print(
        f"{len(trials)} undecided trials, {len(lines) - len(trials)} failed, last drawn: {lines[-1]['trial']}\n"
    )
    print("| one more record | decided for the truth | still open | decided wrongly | truth more probable |")
    print("|---|---|---|---|---|")
    for arm in ARMS:
        after = np.array([trial[arm] for trial in trials if arm in trial])
        right, wrong = int(np.sum(after >= DECIDED)), int(np.sum(after <= 1.0 - DECIDED))
        print(
            f"| {arm} | {right} ({right / after.size:.0%}) | {after.size - right - wrong} | {wrong} | "
            f"{int(np.sum(after > 0.5))} |"
        )
    won, lost = decided_by_one(trials, "plan", "menu"), decided_by_one(trials, "menu", "plan")
    print(f"\nDecided by the plan alone: {won}, by the menu alone: {lost}.\n")
    print("| promised | trials | mean promise | without noise | mean probability of the truth | decided |")
    print("|---|---|---|---|---|---|")
    for low, high in BINS:
        own = [trial for trial in trials if low <= trial["promised"] < high]
        if own:
            means = [np.mean([trial[key] for trial in own]) for key in ("promised", "without_noise", "plan")]
            decided = np.mean([trial["plan"] >= DECIDED for trial in own])
            print(
                f"| {low:g} to {high:g} | {len(own)} | {' | '.join(f'{m:.2f}' for m in means)} | {decided:.0%} |"
            )


def decided_by_one(trials: Sequence[dict[str, Any]], one: str, other: str) -> int:
    """Return the number of trials that one kind of record decides for the truth and the other does not."""
    return sum(trial[one] >= DECIDED > trial[other] for trial in trials)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
