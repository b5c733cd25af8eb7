"""Summary of the outcomes of many trials."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from rigsight_bench.scoring.goals import figures, laboratory_figures, targets
from rigsight_bench.scoring.parameter_errors import OF_RIG, ParameterError
from rigsight_bench.scoring.probability_scores import log_score, probability_scores
from rigsight_bench.scoring.shares import mean, median, quantile, share_of
from rigsight_bench.scoring.trial_outcome import FAILED, Outcome, WithheldError
from rigsight_bench.trials.kinds import SEVERAL, Kind
from rigsight_bench.trials.laboratory.subjects import CONDITIONS

ALL = "all"
"""Of the conditions together."""
WRONG_PLACE = "wrong place"
"""Verdict that names the effects that are hidden, one at least at another place."""
_BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
_AMPLITUDES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Edges between groups of amplitudes [unit of the input]."""
_ERRORS = (0.0, 0.95, 1.0, 1.05, 1.1, 1.25, 1.5, 2.0, 4.0, 10.0)
"""Edges between groups of errors on withheld records [noise floors]."""
_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
_WITHIN = 2.0
"""Standard errors within which 95 % of all errors lie if the standard errors are true."""


def summary(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return the summary of many outcomes, ready for ``blind.json``."""
    goals = figures(outcomes)
    return {
        "goals": goals,
        "targets": targets(goals),
        "confusion": confusion(outcomes),
        "pairs": several(outcomes, "pair"),
        "triples": several(outcomes, "triple"),
        "reliability": reliability(outcomes),
        "probabilities": probability_scores(outcomes),
        "held_out": held_out(outcomes),
        "parameters": parameters(outcomes),
        "conditions": conditions(outcomes),
        "families": families(outcomes),
        "by": {name: _grouped(outcomes, label) for name, label in _GROUPINGS.items()},
        "seconds": {
            "median": median([o.seconds for o in outcomes]),
            "quantile_95": quantile([o.seconds for o in outcomes], 0.95),
            "total": math.fsum(o.seconds for o in outcomes),
        },
        "scored_by": dict(Counter(o.version for o in outcomes).most_common()),
    }


def truth_label(found: Outcome) -> str:
    """Return the hidden effect of a trial as text."""
    prefix = "outside: " if found.kind == "outside" else ""
    return prefix + (" + ".join(found.effects) or found.kind)


def verdict_label(found: Outcome) -> str:
    """Return the verdict of a diagnosis as text."""
    if found.named and found.effect_right and not found.right:
        return WRONG_PLACE
    if found.kind == SEVERAL and found.right:
        # Naming only the main one of several effects counts as right.
        return truth_label(found)
    return " + ".join(found.named) or found.verdict


_GROUPINGS: dict[str, Callable[[Outcome], str]] = {
    "kind": lambda o: o.kind,
    "tier": lambda o: o.tier or "no effect",
    "noise": lambda o: o.noise,
    "rig": lambda o: o.rig,
    "effect": truth_label,
}


def conditions(outcomes: Sequence[Outcome]) -> dict[str, dict[str, Any]]:
    """Return the summary of the laboratory trials for each condition and for all; empty if there are no such trials."""
    taken = [o for o in outcomes if o.condition]
    groups: dict[str, list[Outcome]] = {
        name: [o for o in taken if o.condition == name] for name in CONDITIONS
    }
    rows = {name: _under(found) for name, found in groups.items() if found}
    return {**rows, ALL: _under(taken)} if taken else {}


def families(outcomes: Sequence[Outcome]) -> dict[str, dict[str, Any]]:
    """Return, for each family of hidden effects and for all, how often it was named at its place."""
    groups: dict[str, list[Outcome]] = {}
    for found in outcomes:
        if found.family_right is not None:
            groups.setdefault(ALL, []).append(found)
            groups.setdefault(" + ".join(sorted(set(found.families))), []).append(found)
    return {
        name: {
            "right": share_of(groups[name], lambda o: bool(o.family_right)),
            "probability": mean([o.family_probability or 0.0 for o in groups[name]]),
        }
        for name in sorted(groups, key=lambda name: (name != ALL, name))
    }


def _under(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    unknown = [o for o in outcomes if o.verdict == "unknown"]
    return {
        **laboratory_figures(outcomes),
        "unknown": share_of(outcomes, lambda o: o.verdict == "unknown"),
        "neither": share_of(outcomes, lambda o: not o.named and not o.right and o.verdict != "unknown"),
        "largest_unknown": max((o.stated for o in unknown), default=None),
        "seconds_median": median([o.seconds for o in outcomes]),
    }


def confusion(outcomes: Sequence[Outcome]) -> dict[str, dict[str, int]]:
    """Return truth -> verdict -> number of trials."""
    table: dict[str, Counter[str]] = {}
    for found in outcomes:
        table.setdefault(truth_label(found), Counter())[verdict_label(found)] += 1
    return {truth: dict(counts.most_common()) for truth, counts in sorted(table.items())}


def several(outcomes: Sequence[Outcome], kind: Kind) -> dict[str, int]:
    """Return how many pairs, or triples, were named whole, in part, or not at all."""
    counts = Counter(_named_of_several(o) for o in outcomes if o.kind == kind)
    return dict(counts.most_common())


def _named_of_several(found: Outcome) -> str:
    whole, part = ("both", "one") if len(found.effects) == 2 else ("all", "some")
    if found.right:
        return whole
    if found.effect_right:
        return WRONG_PLACE
    hit = set(found.effects) & set(found.named)
    if not found.named:
        return found.verdict
    if len(hit) == len(found.effects):
        return f"{whole} and another"
    if hit:
        return f"{part} alone" if len(hit) == len(found.named) else f"{part} with another"
    return "others"


def reliability(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return, for bins of the stated probability, its mean and the share of verdicts that were true.

    Failed diagnoses are left out.
    """
    rows, stating = [], [o for o in outcomes if o.verdict != FAILED]
    for lower, upper in pairwise(_BINS):
        inside = [o for o in stating if lower < o.stated <= upper or (lower == 0.0 and o.stated == 0.0)]
        rows.append(
            {
                "from": lower,
                "to": upper,
                "stated": mean([o.stated for o in inside]),
                "right": share_of(inside, lambda o: o.stated_is_true),
            }
        )
    return rows


def held_out(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return how far the models are from withheld records: of all trials whose truth the catalogue holds.

    A model that cannot be simulated there has an infinite error.
    """
    known = [o for o in outcomes if o.kind != "outside" and o.withheld]
    errors = [_endless(o.held_out) for o in known]
    right = np.array([o.right for o in known], dtype=bool)
    place = np.searchsorted(_ERRORS, errors, side="right") - 1
    counts = {
        name: np.bincount(place[chosen], minlength=len(_ERRORS)).tolist()
        for name, chosen in (("right", right), ("wrong", ~right))
    }
    ends = [*_ERRORS[1:], None]
    return {
        "quantiles": {f"{share:g}": quantile(errors, share) for share in _QUANTILES},
        "histogram": [
            {"from": low, "to": ends[i], **{name: count[i] for name, count in counts.items()}}
            for i, low in enumerate(_ERRORS)
        ],
        "by_record": _by_record(record for o in known for record in o.withheld),
    }


def _endless(error: float | None) -> float:
    return math.inf if error is None else error


def _by_record(records: Iterable[WithheldError]) -> dict[str, dict[str, Any]]:
    """Return the errors by kind and amplitude of the withheld record."""
    groups: dict[tuple[str, int], list[float]] = {}
    for record in records:
        place = sum(record.amplitude > edge for edge in _AMPLITUDES[1:])
        groups.setdefault((record.kind, place), []).append(_endless(record.error))
    found = {}
    for kind, place in sorted(groups):
        errors = groups[kind, place]
        above = place == len(_AMPLITUDES) - 1
        size = (
            f"above {_AMPLITUDES[-1]:g}" if above else f"{_AMPLITUDES[place]:g} to {_AMPLITUDES[place + 1]:g}"
        )
        found[f"{kind}, {size}"] = {
            "count": len(errors),
            "median": median(errors),
            "quantile_95": quantile(errors, 0.95),
        }
    return found


def parameters(outcomes: Sequence[Outcome]) -> dict[str, dict[str, Any]]:
    """Return the errors of the numbers in standard errors where the verdict is right: all, the rig's, and each effect's."""
    groups: dict[str, list[ParameterError]] = {}
    for error in (error for o in outcomes for error in o.parameters):
        groups.setdefault("all", []).append(error)
        groups.setdefault(error.of, []).append(error)
    first = {"all": 0, OF_RIG: 1}
    return {
        name: _sizes([abs(e.error) for e in groups[name]])
        for name in sorted(groups, key=lambda n: (first.get(n, 2), n))
    }


def _sizes(errors: Sequence[float]) -> dict[str, Any]:
    return {
        "count": len(errors),
        "within_2": sum(error <= _WITHIN for error in errors) / len(errors),
        "median": median(errors),
        "quantile_95": quantile(errors, 0.95),
    }


def _grouped(outcomes: Sequence[Outcome], label: Callable[[Outcome], str]) -> dict[str, Any]:
    groups: dict[str, list[Outcome]] = {}
    for found in outcomes:
        groups.setdefault(label(found), []).append(found)
    return {value: _figures(groups[value]) for value in sorted(groups)}


def _figures(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    placed = [o for o in outcomes if o.place_right is not None]
    return {
        "right": share_of(outcomes, lambda o: o.right),
        "effect_right": share_of(outcomes, lambda o: o.effect_right),
        "right_within_set": share_of(outcomes, lambda o: o.right_within_set),
        "place_right": share_of(placed, lambda o: bool(o.place_right)),
        "looked_at": share_of([o for o in outcomes if o.looked_at is not None], lambda o: bool(o.looked_at)),
        "log_score": mean([log_score(o.probability) for o in outcomes]),
        "held_out_median": median([_endless(o.held_out) for o in outcomes if o.withheld]),
        "seconds_median": median([o.seconds for o in outcomes]),
    }
