"""A diagnosed trial with known truth, as input of the calibration of probabilities."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

from rigsight.diagnose.verdict.calibration import Situation
from rigsight.diagnose.verdict.judgement import Verdict
from rigsight_bench.scoring.score import BY_PLACE_SCHEMA, effects_at_places, needed_effects

Cause = Literal["first", "listed", "outside"]
"""The true cause is the first of the models tried, another of them, or none of them."""


@dataclass(frozen=True)
class TrainingTrial:
    """A trial as the calibration sees it.

    Attributes
    ----------
    design, seed, trial
        Which trial it is.
    kind
        Of the hidden subject.
    left_out
        True where the hidden effect was not among the candidates.
    situation
        Features from which the probability is computed.
    cause
        Place of the true cause among the tried models.
    share_of_cause
        Its part of the ranking among the models behind the first; 0 where it is none of them.
    """

    design: str
    seed: int
    trial: str
    kind: str
    left_out: bool
    situation: Situation
    cause: Cause
    share_of_cause: float


def training_trial(
    key: Mapping[str, Any], diagnosis: Mapping[str, Any], left_out: bool = False
) -> TrainingTrial:
    """Compare a diagnosis with its key.

    Parameters
    ----------
    key
        As `draw_trial` makes it.
    diagnosis
        Content of ``diagnosis.json``.
    left_out
        True where the hidden effect was not among the candidates.
    """
    by_place = key.get("schema_version", 1) >= BY_PLACE_SCHEMA
    truth, needed = effects_at_places(key, by_place), needed_effects(key, by_place)
    tried = [candidate for candidate in diagnosis["candidates"] if candidate["effects"]]
    shares = [share_of(candidate) for candidate in tried]
    total = math.fsum(shares)
    shares = [share / total if total > 0.0 else 0.0 for share in shares]
    is_true = [bool(needed) and needed <= effects_at_places(c, by_place) <= truth for c in tried]
    verdict = cast("Verdict", diagnosis["verdict"])
    first = first_model(diagnosis, tried)
    has_effect = verdict in ("effect", "unknown")
    is_first = is_true[first] if has_effect and first >= 0 else verdict == key["kind"]
    cause: Cause = "first" if is_first else ("listed" if any(is_true) else "outside")
    rest = math.fsum(s for i, s in enumerate(shares) if i != first or not has_effect)
    own = math.fsum(s for i, s in enumerate(shares) if is_true[i])
    without = next(c for c in diagnosis["candidates"] if not c["effects"])
    chosen = tried[first] if has_effect and first >= 0 else without
    return TrainingTrial(
        str(key["design"]),
        int(key["seed"]),
        str(key["trial"]),
        str(key["kind"]),
        left_out,
        Situation(
            verdict,
            shares[first] if first >= 0 else 0.0,
            _left(chosen),
            _left(without),
            len(chosen["effects"]),
            bool(diagnosis["adequate"]),
            any(floor["lower_bound"] for floor in diagnosis["noise_floor"].values()),
            bool(diagnosis["gap_by_place"]),
        ),
        cause,
        own / rest if cause == "listed" and rest > 0.0 else 0.0,
    )


def first_model(diagnosis: Mapping[str, Any], tried: Sequence[Mapping[str, Any]]) -> int:
    """Return the index of the model that is named, or without a named effect of the first in the ranking; -1 if none was tried.

    Parameters
    ----------
    diagnosis
        Content of ``diagnosis.json``.
    tried
        Its candidates with an effect.
    """
    if diagnosis["verdict"] == "effect":
        named = effects_at_places(diagnosis, True)
        return next(i for i, candidate in enumerate(tried) if effects_at_places(candidate, True) == named)
    return max(range(len(tried)), key=lambda i: share_of(tried[i]), default=-1)


def share_of(candidate: Mapping[str, Any]) -> float:
    """Return a candidate's share of the ranking."""
    return float(candidate["ranking_share"] or 0.0)


def _left(candidate: Mapping[str, Any]) -> float:
    """Return the error over noise; infinite if a model could not be scored."""
    left = candidate["error_over_noise"]
    return math.inf if left is None else float(left)
