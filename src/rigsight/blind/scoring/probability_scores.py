"""Are stated probabilities worth what they say? Proper scores, the slope of reliability, and how often sets hold the truth.

References
----------
T. Gneiting and A. E. Raftery, J. Am. Stat. Assoc. 102 (2007) 359, for scores that reward honesty. D. R. Cox, Biometrika 45 (1958)
562, for the slope. V. Vovk, A. Gammerman and G. Shafer, *Algorithmic Learning in a Random World* (Springer 2005), for the sets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit, log_expit, logit

from rigsight.blind.scoring.score import FAILED, Outcome
from rigsight.blind.scoring.shares import mean, share_of

ALL = "all"
LEAST_PROBABILITY = 1e-3
"""A truth that was given less counts as this much, or one trial alone would set the log score."""


def probability_scores(outcomes: Sequence[Outcome]) -> dict[str, dict[str, Any]]:
    """Return the scores of all outcomes and of each stratum: by verdict, kind of subject, design, and rigs with several places.

    Probabilities can be calibrated in strata that a diagnosis knows of, as those by verdict. By what is hidden they cannot: of
    causes from outside less comes true than is stated, as nobody knows that they are.
    """
    stating = [o for o in outcomes if o.verdict != FAILED]
    strata: dict[str, list[Outcome]] = {ALL: stating}
    for found in stating:
        strata.setdefault(f"verdict: {_verdict(found)}", []).append(found)
        strata.setdefault(f"kind: {found.kind}", []).append(found)
        strata.setdefault(f"design: {found.design}", []).append(found)
        strata.setdefault("one place" if found.looked_at is None else "several places", []).append(found)
    return {name: scores_of(strata[name]) for name in sorted(strata, key=lambda n: (n != ALL, n))}


def _verdict(found: Outcome) -> str:
    if found.verdict == "effect":
        return "one effect" if len(found.named) == 1 else "several effects"
    return found.verdict if found.verdict == "unknown" else "none or parameters"


def scores_of(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return the scores of one group of outcomes.

    ``log_score`` and ``brier`` are of the probability on the truth and on what was stated; ``slope`` and its standard error are
    of the logistic regression of what came true on the log odds of what was stated: 1 is calibrated, less is
    overconfident, more is underconfident. It is None where all came true, or nothing did.
    """
    stated = np.array([o.stated for o in outcomes])
    true = np.array([o.stated_is_true for o in outcomes], dtype=bool)
    slope = reliability_slope(stated, true)
    with_sets = [o for o in outcomes if o.in_set is not None]
    return {
        "count": len(outcomes),
        "log_score": mean([log_score(o.probability) for o in outcomes]),
        "brier": mean(list((stated - true) ** 2)),
        "stated": mean(list(stated)),
        "true": share_of(outcomes, lambda o: o.stated_is_true),
        "slope": None if slope is None else slope[0],
        "slope_error": None if slope is None else slope[1],
        "covered": share_of(with_sets, lambda o: bool(o.in_set)),
        "set_size": mean([float(o.set_size or 0) for o in with_sets]),
    }


def log_score(probability: float) -> float:
    """Return minus the logarithm of the probability that was given to the truth; 0 is perfect."""
    return -math.log(max(probability, LEAST_PROBABILITY))


def reliability_slope(stated: NDArray[np.float64], true: NDArray[np.bool_]) -> tuple[float, float] | None:
    """Return slope and standard error of the logistic regression of events on their stated log odds.

    Parameters
    ----------
    stated
        Probabilities, shape (n,).
    true
        Whether each came true, shape (n,).

    Returns
    -------
    None where one number parts what came true from what did not: then no slope is the likeliest.
    """
    if true.all() or not true.any():
        return None
    log_odds = logit(np.clip(stated, LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY))
    separated = np.min(log_odds[true]) >= np.max(log_odds[~true])
    if separated or np.max(log_odds[true]) <= np.min(log_odds[~true]):
        return None
    design = np.column_stack([np.ones_like(log_odds), log_odds])
    signs = np.where(true, 1.0, -1.0)

    def cost(beta: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        told = signs * (design @ beta)
        return -float(np.sum(log_expit(told))), -(signs * expit(-told)) @ design

    found = minimize(cost, np.array([0.0, 1.0]), jac=True, method="BFGS").x
    p = expit(design @ found)
    information = design.T @ (design * (p * (1.0 - p))[:, None])
    return float(found[1]), float(np.sqrt(np.linalg.inv(information)[1, 1]))
