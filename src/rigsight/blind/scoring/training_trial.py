"""A diagnosed trial with known truth, as input of the calibration of probabilities."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, cast

from rigsight.blind.scoring.score import BY_PLACE_SCHEMA, effects_at_places, needed_effects
from rigsight.diagnose import Situation, Verdict

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
    shares = [_share(candidate) for candidate in tried]
    total = math.fsum(shares)
    shares = [share / total if total > 0.0 else 0.0 for share in shares]
    is_true = [bool(needed) and needed <= effects_at_places(c, by_place) <= truth for c in tried]
    named = effects_at_places(diagnosis, by_place)
    verdict = cast("Verdict", diagnosis["verdict"])
    if verdict == "effect":
        first = next(i for i, c in enumerate(tried) if effects_at_places(c, by_place) == named)
    else:
        first = max(range(len(tried)), key=shares.__getitem__, default=-1)
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


def _share(candidate: Mapping[str, Any]) -> float:
    return float(candidate["ranking_share"] or 0.0)


def _left(candidate: Mapping[str, Any]) -> float:
    """Return the error over noise; infinite if a model could not be scored."""
    left = candidate["error_over_noise"]
    return math.inf if left is None else float(left)
