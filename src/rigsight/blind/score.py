"""How good is a diagnosis whose truth is known? One outcome per trial, and what many of them add up to."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import binomtest

from rigsight.blind.subjects import TIERS

_LEAST_PROBABILITY = 1e-3
"""A truth that was given less counts as this much, or one trial alone would set the log score."""
_BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
_LARGE_GAP = TIERS["clear"][0]


@dataclass(frozen=True)
class Outcome:
    """What came of one trial.

    Attributes
    ----------
    trial, kind, effects, rig, noise
        From the key: number, kind of subject, hidden effects, rig, noise level.
    gap
        What the re-identified equations leave on validation records, in units of the true noise floor.
    tier
        Strength by that gap; "below" where it is smaller than the faintest, "" where nothing is hidden.
    verdict, named
        Verdict and named effects; verdict "failed" where the diagnosis ended with an error.
    right
        The verdict is the truth: the very effects, or none, parameters, and unknown for an effect from outside.
    right_within_set
        Right, or the truth is among those that the diagnosis cannot tell from what it names.
    place_right
        The places named are those of the hidden effects; None where nothing is hidden.
    probability
        On the truth; for an effect from outside, what is left beside all candidates.
    stated
        On what the verdict says.
    held_out
        RMS error on the withheld records in units of the true noise floor, from the model alone; None without a model.
    seconds
        Time of the diagnosis.
    message
        Why it failed.
    """

    trial: int
    kind: str
    effects: tuple[str, ...]
    rig: str
    noise: str
    gap: float
    tier: str
    verdict: str
    named: tuple[str, ...]
    right: bool
    right_within_set: bool
    place_right: bool | None
    probability: float
    stated: float
    held_out: float | None
    seconds: float
    message: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the outcome for ``blind.json``."""
        return asdict(self)


@dataclass(frozen=True)
class Share:
    """How many of how many, with the Wilson interval of 95 %."""

    count: int
    total: int

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of the share; everything where nothing was tried."""
        if self.total == 0:
            return 0.0, 1.0
        found = binomtest(self.count, self.total).proportion_ci(confidence_level=0.95, method="wilson")
        return float(found.low), float(found.high)

    def to_json(self) -> dict[str, Any]:
        """Return count, total, share and interval."""
        share = self.count / self.total if self.total else None
        return {"count": self.count, "total": self.total, "share": share, "interval": list(self.interval)}


def outcome(
    key: Mapping[str, Any],
    diagnosis: Mapping[str, Any] | None,
    held_out: float | None,
    seconds: float,
    message: str = "",
) -> Outcome:
    """Hold a diagnosis against its key.

    Parameters
    ----------
    key
        As `draw_trial` makes it.
    diagnosis
        Content of ``diagnosis.json``; None if the diagnosis failed.
    held_out
        See `Outcome`.
    seconds
        Time of the diagnosis.
    message
        Why it failed.
    """
    found = diagnosis or {
        "verdict": "failed",
        "effects": [],
        "where": [],
        "ambiguous_with": [],
        "candidates": [],
    }
    kind = str(key["kind"])
    truth, named = frozenset(key["effects"]), frozenset(found["effects"])
    verdict = str(found["verdict"])
    expected = {"none": "none", "parameters": "parameters", "outside": "unknown"}.get(kind, "effect")
    right = verdict == expected and (expected != "effect" or named == truth)
    within = expected == "effect" and truth in [frozenset(rival) for rival in found["ambiguous_with"]]
    candidates = {frozenset(c["effects"]): float(c["probability"] or 0.0) for c in found["candidates"]}
    left = max(0.0, 1.0 - sum(candidates.values()))
    probability = left if kind == "outside" else candidates.get(truth, 0.0)
    if verdict == "failed":
        probability = 0.0
    return Outcome(
        trial=int(key["trial"]),
        kind=kind,
        effects=tuple(sorted(truth)),
        rig=str(key["rig"]),
        noise=str(key["noise"]),
        gap=float(key["gap"]),
        tier=_tier(float(key["gap"])) if truth else "",
        verdict=verdict,
        named=tuple(sorted(named)),
        right=right,
        right_within_set=right or within,
        place_right=frozenset(found["where"]) == frozenset(key["where"]) if truth else None,
        probability=probability,
        stated=left if verdict in ("unknown", "failed") else candidates.get(named, 0.0),
        held_out=held_out,
        seconds=seconds,
        message=message,
    )


def _tier(gap: float) -> str:
    reached = [tier for tier, (least, _) in TIERS.items() if gap >= least]
    return reached[-1] if reached else "below"


def summary(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return what many outcomes add up to, ready for ``blind.json``."""
    return {
        "goals": goals(outcomes),
        "confusion": confusion(outcomes),
        "reliability": reliability(outcomes),
        "by": {name: _grouped(outcomes, label) for name, label in _GROUPINGS.items()},
        "wrong": [o.trial for o in outcomes if not o.right],
    }


def truth_label(found: Outcome) -> str:
    """Return what a trial hid, in words."""
    prefix = "outside: " if found.kind == "outside" else ""
    return prefix + (" + ".join(found.effects) or found.kind)


def verdict_label(found: Outcome) -> str:
    """Return what a diagnosis said, in words."""
    return " + ".join(found.named) or found.verdict


_GROUPINGS: dict[str, Callable[[Outcome], str]] = {
    "kind": lambda o: o.kind,
    "tier": lambda o: o.tier or "no effect",
    "noise": lambda o: o.noise,
    "rig": lambda o: o.rig,
    "effect": truth_label,
}


def goals(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return the figures for which the project has set itself goals."""
    large = [o for o in outcomes if o.gap >= _LARGE_GAP]
    singles = [o for o in large if o.kind == "single"]
    pairs = [o for o in large if o.kind == "pair"]
    faint = [o for o in outcomes if o.kind == "single" and o.tier == "faint"]
    outside = [o for o in outcomes if o.kind == "outside"]
    controls = [o for o in outcomes if o.kind in ("none", "parameters")]
    known = [*singles, *pairs, *controls]
    return {
        "singles_right": _share(singles, lambda o: o.right),
        "singles_right_within_set": _share(singles, lambda o: o.right_within_set),
        "singles_place_right": _share(singles, lambda o: bool(o.place_right)),
        "pairs_right": _share(pairs, lambda o: o.right),
        "pairs_right_within_set": _share(pairs, lambda o: o.right_within_set),
        "controls_right": _share(controls, lambda o: o.right),
        "outside_unknown": _share(outside, lambda o: o.right),
        "outside_unknown_large_gap": _share([o for o in outside if o.gap >= _LARGE_GAP], lambda o: o.right),
        "outside_named_above_half": _share(outside, lambda o: bool(o.named) and o.stated > 0.5),
        "faint_right": _share(faint, lambda o: o.right),
        "faint_right_within_set": _share(faint, lambda o: o.right_within_set),
        "mean_probability": _mean(o.probability for o in known),
        "log_score": _mean(-math.log(max(o.probability, _LEAST_PROBABILITY)) for o in known),
        "held_out_median": _median([*singles, *pairs]),
        "seconds_median": float(np.median([o.seconds for o in outcomes])) if outcomes else None,
    }


def confusion(outcomes: Sequence[Outcome]) -> dict[str, dict[str, int]]:
    """Return truth -> verdict -> number of trials."""
    table: dict[str, Counter[str]] = {}
    for found in outcomes:
        table.setdefault(truth_label(found), Counter())[verdict_label(found)] += 1
    return {truth: dict(counts.most_common()) for truth, counts in sorted(table.items())}


def reliability(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return, for bins of the stated probability, its mean and the share of verdicts that were right."""
    rows = []
    for lower, upper in pairwise(_BINS):
        inside = [o for o in outcomes if lower < o.stated <= upper or (lower == 0.0 and o.stated == 0.0)]
        rows.append(
            {
                "from": lower,
                "to": upper,
                "stated": _mean(o.stated for o in inside),
                "right": _share(inside, lambda o: o.right),
            }
        )
    return rows


def _grouped(outcomes: Sequence[Outcome], label: Callable[[Outcome], str]) -> dict[str, Any]:
    groups: dict[str, list[Outcome]] = {}
    for found in outcomes:
        groups.setdefault(label(found), []).append(found)
    return {value: _figures(groups[value]) for value in sorted(groups)}


def _figures(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    hiding = [o for o in outcomes if o.place_right is not None]
    return {
        "right": _share(outcomes, lambda o: o.right),
        "right_within_set": _share(outcomes, lambda o: o.right_within_set),
        "place_right": _share(hiding, lambda o: bool(o.place_right)),
        "mean_probability": _mean(o.probability for o in outcomes),
        "held_out_median": _median(outcomes),
    }


def _share(outcomes: Sequence[Outcome], counts: Callable[[Outcome], bool]) -> dict[str, Any]:
    return Share(sum(map(counts, outcomes)), len(outcomes)).to_json()


def _mean(values: Iterable[float]) -> float | None:
    listed = list(values)
    return float(np.mean(listed)) if listed else None


def _median(outcomes: Sequence[Outcome]) -> float | None:
    errors = [o.held_out for o in outcomes if o.held_out is not None]
    return float(np.median(errors)) if errors else None
