"""Fit the weights of families to the trials of `run.py`: maximum likelihood, and each rig by the others."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from rigsight.diagnose.policy import SEARCH

HERE = Path(__file__).parent
BINS = (0.0, 0.3, 0.5, 0.7, 0.9, 1.0)
SMALLEST = 1e-6
"""Probability that a likelihood takes at least."""


def probabilities(trial: dict[str, Any], power: float, others: float) -> np.ndarray:
    """Return the probability of each family of a trial, then that of any other cause."""
    remains = 1.0 - np.clip([share for *_, share in trial["alone"]], 0.0, 1.0) + SEARCH.law_error**2
    power *= 1.0 - trial["by_chance"]
    weights = np.append((remains / (1.0 + SEARCH.law_error**2)) ** -power, others)
    return np.asarray(weights / np.sum(weights))


def of_truth(trial: dict[str, Any], chances: np.ndarray) -> float:
    """Return the probability of the hidden family at its place, of another cause if the motion does not judge it."""
    for (family, where, _), chance in zip(trial["alone"], chances, strict=False):
        if (family, where) == (trial["family"], trial["where"]):
            return float(chance)
    # A family that the motion does not judge is one of the other causes.
    return float(chances[-1])


def fitted(trials: Sequence[dict[str, Any]]) -> tuple[float, float]:
    """Return power and weight of other causes with the largest likelihood."""

    def cost(logarithms: np.ndarray) -> float:
        power, others = np.exp(logarithms)
        chances = [of_truth(trial, probabilities(trial, power, others)) for trial in trials]
        return -float(np.mean(np.log(np.maximum(chances, SMALLEST))))

    power, others = np.exp(minimize(cost, [1.0, 0.5], method="Nelder-Mead").x)
    return float(power), float(others)


def main() -> None:
    """Fit and print."""
    trials = [
        json.loads(line)
        for file in sorted(HERE.glob("trials_*.jsonl"))
        for line in file.open(encoding="utf-8")
    ]
    power, others = fitted(trials)
    print(
        f"{len(trials)} trials of {len({t['campaign'] for t in trials})} campaigns: power {power:.2f}, others {others:.2f}"
    )
    stated, true, scores = [], [], []
    for campaign in sorted({trial["campaign"] for trial in trials}):
        own = fitted([trial for trial in trials if trial["campaign"] != campaign])
        for trial in (trial for trial in trials if trial["campaign"] == campaign):
            chances = probabilities(trial, *own)
            scores.append(-np.log(max(of_truth(trial, chances), SMALLEST)))
            first = int(np.argmax(chances[:-1]))
            stated.append(chances[first])
            true.append(tuple(trial["alone"][first][:2]) == (trial["family"], trial["where"]))
            if chances[first] > 0.7 and not true[-1]:
                print(
                    f"  wrong {chances[first]:.2f}: {campaign}, {trial['effect']} called {trial['alone'][first][0]}"
                )
    print(f"Each campaign by the others: log score {np.mean(scores):.2f}, right {np.mean(true):.2f}")
    for low, high in pairwise(BINS):
        at = [t for p, t in zip(stated, true, strict=True) if low <= p < high or p == high == 1.0]
        if at:
            print(f"  stated {low:.1f} to {high:.1f}: {len(at)} trials, {np.mean(at):.2f} right")


if __name__ == "__main__":
    main()
