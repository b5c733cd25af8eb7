"""Do stated probabilities match frequencies? Log score, Brier score, slope and offset of reliability, and coverage of sets.

References
----------
T. Gneiting and A. E. Raftery, J. Am. Stat. Assoc. 102 (2007) 359, for scores that reward honesty. D. R. Cox, Biometrika 45 (1958)
562, for slope and offset. V. Vovk, A. Gammerman and G. Shafer, *Algorithmic Learning in a Random World* (Springer 2005), for
the sets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize
from scipy.special import expit, log_expit, logit

from rigsight_bench.scoring.shares import mean, share_of
from rigsight_bench.scoring.trial_outcome import FAILED, Outcome

ALL = "all"
LEAST_PROBABILITY = 1e-3
"""A true cause with less counts as this much, or one trial alone would set the log score."""
_FARTHEST = 50.0
"""Offset of log odds that no set of trials reaches."""


def probability_scores(outcomes: Sequence[Outcome]) -> dict[str, dict[str, Any]]:
    """Return the scores of all outcomes and of each stratum: by verdict, kind of subject, design, and rigs with several places.

    Probabilities can be calibrated in strata that a diagnosis knows of, as those by verdict. By what is hidden they cannot: of
    causes from outside less comes true than is stated, as nobody knows that they are.
    """
    strata: dict[str, list[Outcome]] = {ALL: list(outcomes)}
    for found in outcomes:
        strata.setdefault(f"kind: {found.kind}", []).append(found)
        strata.setdefault(f"design: {found.design}", []).append(found)
        if found.verdict != FAILED:
            strata.setdefault(f"verdict: {_verdict(found)}", []).append(found)
            strata.setdefault("several places" if found.several_places else "one place", []).append(found)
    return {name: scores_of(strata[name]) for name in sorted(strata, key=lambda n: (n != ALL, n))}


def _verdict(found: Outcome) -> str:
    if found.verdict == "effect":
        return "one effect" if len(found.named) == 1 else "several effects"
    return found.verdict if found.verdict == "unknown" else "none or parameters"


def scores_of(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return the scores of one group of outcomes.

    ``log_score`` is that of the probability of the true cause; a diagnosis that failed gave it none. The others are of what was
    stated, without failed diagnoses: ``slope`` of the logistic regression of what came true on the log odds of what was
    stated: 1 if calibrated, less if overconfident, more if underconfident. ``offset`` is the intercept of that regression with
    slope 1: below 0 if too much is stated on average. Both have a standard error; they are None if all were right, or all wrong.
    """
    stating = [o for o in outcomes if o.verdict != FAILED]
    stated = np.array([o.stated for o in stating])
    true = np.array([o.stated_is_true for o in stating], dtype=bool)
    slope, offset = reliability_slope(stated, true), reliability_offset(stated, true)
    with_sets = [o for o in stating if o.in_set is not None]
    return {
        "count": len(outcomes),
        "failed": len(outcomes) - len(stating),
        "log_score": mean([log_score(o.probability) for o in outcomes]),
        "brier": mean(list((stated - true) ** 2)),
        "stated": mean(list(stated)),
        "true": share_of(stating, lambda o: o.stated_is_true),
        "slope": None if slope is None else slope[0],
        "slope_error": None if slope is None else slope[1],
        "offset": None if offset is None else offset[0],
        "offset_error": None if offset is None else offset[1],
        "covered": share_of(with_sets, lambda o: bool(o.in_set)),
        "set_size": mean([float(o.set_size or 0) for o in with_sets]),
    }


def log_score(probability: float) -> float:
    """Return minus the logarithm of the probability of the true cause; 0 is perfect."""
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
    log_odds = _log_odds(stated)
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


def reliability_offset(stated: NDArray[np.float64], true: NDArray[np.bool_]) -> tuple[float, float] | None:
    """Return what must be added to the stated log odds so that as many come true as stated, and its standard error.

    Arguments are those of `reliability_slope`. None if all came true, or none did.
    """
    if true.all() or not true.any():
        return None
    log_odds = _log_odds(stated)
    found = brentq(lambda offset: float(np.sum(expit(log_odds + offset) - true)), -_FARTHEST, _FARTHEST)
    p = expit(log_odds + found)
    return float(found), float(1.0 / np.sqrt(np.sum(p * (1.0 - p))))


def _log_odds(stated: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(logit(np.clip(stated, LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY)))
