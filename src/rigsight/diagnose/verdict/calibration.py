"""Probability of the named cause: two small logistic models, trained on simulated random rigs whose cause is known.

The first gives the probability that the cause is among the models tried, the second the probability that it is the first of them.
Both use a few figures of the diagnosis, see `Situation`. The coefficients are in ``calibration.json``, which ``make calibrate``
regenerates from the table of training trials in ``experiments/calibration``.

References
----------
J. Platt, in *Advances in Large Margin Classifiers* (MIT Press 2000) 61, for probabilities by a logistic model of a score.
M. Sadinle, J. Lei and L. Wasserman, J. Am. Stat. Assoc. 114 (2019) 223, for the smallest sets of a stated coverage.
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib import resources
from typing import Any

import numpy as np
from scipy.optimize import isotonic_regression
from scipy.special import expit

from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.verdict.judgement import Verdict

FILE = "calibration.json"
_STEEPEST = 6.0
"""Log odds of a share of the ranking beyond which resampling tells nothing: a thousand resamplings were drawn."""


@dataclass(frozen=True)
class Situation:
    """Figures from which the probability of a verdict is computed.

    Attributes
    ----------
    verdict
        The verdict.
    first_share
        Share of the first model in the ranking of those with an effect, 0 to 1.
    remainder, gap
        Errors of that model and of the re-identified equations, in units of the noise floor.
    n_effects
        Number of its effects.
    adequate
        Whether its residual counts as noise and disturbance.
    lower_bound
        Whether the noise floor is only a lower bound.
    several_places
        Whether effects had to be placed.
    """

    verdict: Verdict
    first_share: float
    remainder: float
    gap: float
    n_effects: int
    adequate: bool
    lower_bound: bool
    several_places: bool

    def with_noise(self, largest_gap: float) -> Situation:
        """Return the same with so much noise added to the sensors that the gap is at most `largest_gap` noise floors."""
        if not self.gap > largest_gap:
            return self
        smaller = _above_floor(largest_gap) / _above_floor(self.gap)
        return replace(
            self, remainder=math.hypot(1.0, smaller * _above_floor(self.remainder)), gap=largest_gap
        )

    def figures(self) -> dict[str, float]:
        """Return the inputs of the logistic models by name."""
        has_effect = self.verdict in ("effect", "unknown")
        share = min(max(self.first_share, 0.0), 1.0)
        log_odds = math.log((share + 1e-12) / (1.0 - share + 1e-12))
        remainder, gap = max(self.remainder, 1.0), max(self.gap, 1.0)
        return {
            "log_odds_of_first": max(-_STEEPEST, min(_STEEPEST, log_odds)) if has_effect else 0.0,
            "log_left": math.log(remainder / VERDICT.at_floor)
            if has_effect and remainder > VERDICT.at_floor
            else 0.0,
            "log_gap": math.log(gap) if has_effect else 0.0,
            "more_effects": float(max(self.n_effects - 1, 0)) if self.verdict == "effect" else 0.0,
            "inadequate": float(not self.adequate),
            "lower_bound": float(self.lower_bound),
            "several_places": float(self.several_places),
            "no_effect": float(not has_effect),
            "unknown": float(self.verdict == "unknown"),
        }


@dataclass(frozen=True)
class Calibration:
    """Coefficients of both models, and the threshold of the sets.

    Attributes
    ----------
    listed, first
        Coefficients by figure, with ``"intercept"``: that the cause is among the models tried, and that it is the first of them
        if it is.
    least_probability
        Models with at least this probability belong to the set, which contains the cause in nine trials of ten.
    n_trials
        Training trials.
    largest_gap
        Of them, in units of the noise floor. A larger gap is seen as if noise were added until it is as large: what can be
        concluded with more noise holds with less.
    """

    listed: Mapping[str, float]
    first: Mapping[str, float]
    least_probability: float
    n_trials: int
    largest_gap: float

    def probability_listed(self, situation: Situation) -> float:
        """Return the probability that the cause is among the models tried."""
        return _logistic(self.listed, situation.with_noise(self.largest_gap).figures())

    def probability_first(self, situation: Situation) -> float:
        """Return the probability that the cause is the first model if it is among those tried."""
        return _logistic(self.first, situation.with_noise(self.largest_gap).figures())

    def probabilities(self, situation: Situation, shares: Sequence[float]) -> list[float]:
        """Return the probability of each model with an effect; the rest to 1 is that of all other causes.

        Parameters
        ----------
        situation
            The diagnosis.
        shares
            Of the ranking, the first model's first. The others share in their proportion what the first one leaves; none becomes
            more probable than the first, or than one with a larger share.
        """
        if not shares:
            return []
        listed, first = self.probability_listed(situation), self.probability_first(situation)
        if situation.verdict in ("none", "parameters"):
            return _in_proportion(listed * (1.0 - first), shares)
        if len(shares) == 1:
            return [listed * first]
        separate = np.array([listed * first, *_in_proportion(listed * (1.0 - first), shares[1:])])
        # Where the first is doubted, a rival with nearly the same share must not become more probable than it.
        order = np.argsort([-math.inf, *(-share for share in shares[1:])], kind="stable")
        probabilities = np.empty_like(separate)
        probabilities[order] = isotonic_regression(separate[order], increasing=False).x
        return [float(probability) for probability in probabilities]

    def without_effect(self, situation: Situation) -> float:
        """Return the probability that the equations need no effect."""
        if situation.verdict in ("none", "parameters"):
            return self.probability_listed(situation) * self.probability_first(situation)
        return 0.0

    def to_json(self) -> dict[str, Any]:
        """Return the content of the file."""
        return asdict(self)


@functools.cache
def trained() -> Calibration:
    """Return the calibration included in the package."""
    text = resources.files(__package__).joinpath(FILE).read_text(encoding="utf-8")
    return Calibration(**json.loads(text))


def _above_floor(error: float) -> float:
    """Return the part of an error that is not noise, in units of the noise. The square of a large one may overflow."""
    return math.sqrt(error - 1.0) * math.sqrt(error + 1.0) if error > 1.0 else 0.0


def _logistic(coefficients: Mapping[str, float], figures: Mapping[str, float]) -> float:
    reported = sum(
        value * (1.0 if name == "intercept" else figures[name]) for name, value in coefficients.items()
    )
    return float(expit(reported))


def _in_proportion(total: float, shares: Sequence[float]) -> list[float]:
    whole = math.fsum(shares)
    return [total * share / whole if whole > 0.0 else 0.0 for share in shares]
