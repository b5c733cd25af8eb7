"""Fit the calibration of probabilities to the table of training trials, and write it into the package: `make calibrate`.

Two logistic models with a ridge (scikit-learn), and the threshold of the sets by leave-one-out conformal prediction: each trial's
probability comes from models that were fitted without it.

References
----------
R. J. Tibshirani et al., NeurIPS (2019), for conformal quantiles of weighted trials.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import LeaveOneOut
from table import is_judgeable, read_table

import rigsight.diagnose.verdict
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.verdict.calibration import FILE, Calibration
from rigsight_bench.scoring.training_trial import TrainingTrial

TARGET = Path(rigsight.diagnose.verdict.__file__).parent / FILE
DIGITS = 4
LISTED = ("log_left", "log_gap", "more_effects", "inadequate", "lower_bound", "unknown", "no_effect")
"""Figures that tell whether the cause is among the models tried."""
FIRST = ("log_odds_of_first", "more_effects", "inadequate", "several_places", "no_effect")
"""Figures that tell whether it is the first of them."""


def main() -> None:
    """Fit, write, and print how well it does on trials that it was not fitted to."""
    trials = [trial for trial in read_table() if is_judgeable(trial)]
    calibration = calibrated(trials)
    TARGET.write_text(json.dumps(calibration.to_json(), indent=2) + "\n", encoding="utf-8")
    print(_report(trials, calibration))


def calibrated(trials: Sequence[TrainingTrial]) -> Calibration:
    """Return the calibration that a table gives."""
    least = _least_probability(probabilities_unseen(trials), weights_of(trials))
    return _fitted(trials, math.floor(least * 10**DIGITS) / 10**DIGITS)


def _least_probability(unseen: np.ndarray, weights: np.ndarray) -> float:
    """Return the weighted conformal quantile of the probability of the true cause; the next trial weighs as much as the mean."""
    order = np.argsort(unseen)[::-1]
    share = np.cumsum(weights[order]) / (np.sum(weights) + np.mean(weights))
    enough = np.flatnonzero(share >= VERDICT.set_coverage)
    return float(unseen[order[enough[0] if enough.size else -1]])


def probabilities_unseen(trials: Sequence[TrainingTrial]) -> np.ndarray:
    """Return the probability on the true cause from models fitted without the trial, shape (n_trials,)."""
    found = np.empty(len(trials))
    for rest, own in LeaveOneOut().split(found):
        model = _fitted([trials[i] for i in rest], 0.0)
        found[own] = [probability_of_truth(model, trials[i]) for i in own]
    return found


def probability_of_truth(model: Calibration, trial: TrainingTrial) -> float:
    """Return the probability that a calibration gives to the true cause."""
    listed, first = model.probability_listed(trial.situation), model.probability_first(trial.situation)
    if trial.cause == "outside":
        return 1.0 - listed
    return listed * first if trial.cause == "first" else listed * (1.0 - first) * trial.share_of_cause


def _fitted(trials: Sequence[TrainingTrial], least: float) -> Calibration:
    weights = weights_of(trials)
    is_listed = np.array([trial.cause != "outside" for trial in trials])
    inside = [trial for trial in trials if trial.cause != "outside"]
    return Calibration(
        _logistic(LISTED, trials, is_listed, weights),
        _logistic(
            FIRST, inside, np.array([trial.cause == "first" for trial in inside]), np.ones(len(inside))
        ),
        least,
        len(trials),
        max(trial.situation.gap for trial in trials),
    )


def weights_of(trials: Sequence[TrainingTrial]) -> np.ndarray:
    """Return weights with which causes from outside are as frequent as the policy takes them to be, where something is hidden."""
    hidden = np.array([trial.kind not in ("none", "parameters") for trial in trials])
    outside = hidden & np.array([trial.left_out or trial.kind == "outside" for trial in trials])
    weights = np.ones(len(trials))
    n_hidden, n_outside = int(np.sum(hidden)), int(np.sum(outside))
    if 0 < n_outside < n_hidden:
        weights[outside] = VERDICT.prior_outside * n_hidden / n_outside
        weights[hidden & ~outside] = (1.0 - VERDICT.prior_outside) * n_hidden / (n_hidden - n_outside)
    return weights


def _logistic(
    names: Sequence[str], trials: Sequence[TrainingTrial], happened: np.ndarray, weights: np.ndarray
) -> dict[str, float]:
    figures = np.array([[trial.situation.figures()[name] for name in names] for trial in trials])
    model = LogisticRegression(C=1.0, tol=1e-8, max_iter=10_000).fit(figures, happened, sample_weight=weights)
    told = {name: round(float(value), DIGITS) for name, value in zip(names, model.coef_[0], strict=True)}
    return {"intercept": round(float(model.intercept_[0]), DIGITS), **told}


def _report(trials: Sequence[TrainingTrial], calibration: Calibration) -> str:
    unseen = probabilities_unseen(trials)
    weights = weights_of(trials)
    log_score = float(np.average(-np.log(np.maximum(unseen, 1e-3)), weights=weights))
    names = dict.fromkeys([*calibration.listed, *calibration.first])
    rows = [
        f"| {name} | {_told(calibration.listed.get(name))} | {_told(calibration.first.get(name))} |"
        for name in names
    ]
    return "\n".join(
        [
            f"{len(trials)} trials, {sum(t.left_out for t in trials)} of them with the effect left out.",
            f"Log score on trials not fitted, outside at {VERDICT.prior_outside:g}: {log_score:.3f}.",
            f"Sets of {VERDICT.set_coverage:.0%}: all that is at least {calibration.least_probability:g} probable.",
            "",
            "| figure | the cause is listed | it is the first |",
            "|---|---|---|",
            *rows,
        ]
    )


def _told(coefficient: float | None) -> str:
    return "" if coefficient is None else f"{coefficient:.2f}"


if __name__ == "__main__":
    main()
