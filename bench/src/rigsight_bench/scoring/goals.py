"""Goals of a diagnosis, and whether they are reached."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rigsight_bench.scoring.probability_scores import log_score
from rigsight_bench.scoring.shares import mean, mean_interval, median, median_interval, share_of
from rigsight_bench.scoring.trial_outcome import Outcome
from rigsight_bench.trials.kinds import TIERS

_LARGE_GAP = TIERS["clear"][0]
_GAP_OF_SEVERAL = 2.0 * _LARGE_GAP
"""Each of several effects shows only a part of the gap."""
_CONTROLS = ("none", "parameters")


@dataclass(frozen=True)
class Goal:
    """A figure that is to be at least, or at most, so large."""

    target: float
    at_most: bool = False

    def reached(self, value: float) -> bool:
        """Return True if a figure is good enough."""
        return value <= self.target if self.at_most else value >= self.target


GOALS: dict[str, Goal] = {
    "singles_right": Goal(0.98),
    "singles_place_right": Goal(0.99),
    "controls_right": Goal(0.98),
    "outside_right_large_gap": Goal(0.90),
    "pairs_right": Goal(0.90),
    "log_score": Goal(0.25, at_most=True),
    "held_out_median": Goal(1.1, at_most=True),
}
"""For gaps of at least five times the noise floor, ten for several effects; controls have none."""
TRIPLES_GOALS: dict[str, Goal] = {"triples_right": Goal(0.80)}
"""Where triples were tried."""
LABORATORY_GOALS: dict[str, Goal] = {
    "laboratory_right": Goal(0.90),
    "laboratory_wrong_name": Goal(0.02, at_most=True),
    "laboratory_sure_unknown": Goal(0.0, at_most=True),
}
"""For records as laboratories take them: effect and place right, another effect named, and `unknown` although it is known."""
SURE = 0.9
"""Probability from which an `unknown` is called sure."""


def figures(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return the figures for which there are goals, and the accompanying ones.

    Trials of a laboratory count towards its own goals alone, and towards the log score.
    """
    log_scores = [log_score(o.probability) for o in outcomes if is_clear(o)]
    taken, outcomes = [o for o in outcomes if o.condition], [o for o in outcomes if not o.condition]
    clear = [o for o in outcomes if is_clear(o)]
    singles, pairs, triples = ([o for o in clear if o.kind == kind] for kind in ("single", "pair", "triple"))
    faint = [o for o in outcomes if o.kind == "single" and o.tier == "faint"]
    outside = [o for o in outcomes if o.kind == "outside"]
    controls = [o for o in outcomes if o.kind in _CONTROLS]
    effects = [*singles, *pairs, *triples]
    # A model that cannot be simulated on a withheld record has an infinite error.
    errors = [math.inf if o.held_out is None else o.held_out for o in effects if o.withheld]
    return {
        "singles_right": share_of(singles, lambda o: o.right),
        "singles_right_within_set": share_of(singles, lambda o: o.right_within_set),
        "singles_place_right": share_of(
            [o for o in singles if o.place_right is not None], lambda o: bool(o.place_right)
        ),
        "singles_effect_right": share_of(singles, lambda o: o.effect_right),
        "looked_at": share_of([o for o in effects if o.looked_at is not None], lambda o: bool(o.looked_at)),
        "pairs_right": share_of(pairs, lambda o: o.right),
        "pairs_right_within_set": share_of(pairs, lambda o: o.right_within_set),
        "triples_right": share_of(triples, lambda o: o.right),
        "triples_right_within_set": share_of(triples, lambda o: o.right_within_set),
        "controls_right": share_of(controls, lambda o: o.right),
        "outside_right": share_of(outside, lambda o: o.right),
        "outside_right_large_gap": share_of([o for o in clear if o.kind == "outside"], lambda o: o.right),
        "outside_unknown": share_of(outside, lambda o: o.verdict == "unknown"),
        "outside_named_above_half": share_of(outside, lambda o: bool(o.named) and o.stated > 0.5),
        "faint_right": share_of(faint, lambda o: o.right),
        "faint_right_within_set": share_of(faint, lambda o: o.right_within_set),
        "log_score": mean(log_scores),
        "log_score_interval": list(mean_interval(log_scores)),
        "log_score_total": len(log_scores),
        "held_out_median": median(errors),
        "held_out_median_interval": list(median_interval(errors)),
        "held_out_median_total": len(errors),
        "seconds_median": median([o.seconds for o in (*taken, *outcomes)]),
        **laboratory_figures(taken),
    }


def is_clear(found: Outcome) -> bool:
    """Return True for a control, and for a gap of at least five times the noise floor, ten for several effects.

    An unknown gap counts as a large one, otherwise a failed diagnosis would not count at all.

    Parameters
    ----------
    found
        Outcome of a trial.
    """
    least = _GAP_OF_SEVERAL if found.kind in ("pair", "triple") else _LARGE_GAP
    return found.kind in _CONTROLS or found.gap is None or found.gap >= least


def laboratory_figures(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return the figures for which a laboratory's trials have goals."""
    return {
        "laboratory_right": share_of(outcomes, lambda o: o.right),
        "laboratory_wrong_name": share_of(outcomes, names_wrong),
        "laboratory_sure_unknown": share_of(outcomes, lambda o: o.verdict == "unknown" and o.stated > SURE),
    }


def names_wrong(found: Outcome) -> bool:
    """Return True if an effect is named that is not there, not at that place, or not the main one of several."""
    return bool(found.named) and not found.right


def targets(found: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return every goal beside its figure; `reached` is None where nothing was tried.

    The goals for a laboratory's records stand there where such were tried, and alone where nothing else was.

    `decided` says that the interval of 95 % lies on one side of the goal: so many trials are enough to tell.
    """
    rows = []
    goals = {**GOALS, **(TRIPLES_GOALS if found["triples_right"]["total"] else {})}
    if found["laboratory_right"]["total"]:
        others = any(
            found[name]["total"]
            for name in ("singles_right", "pairs_right", "triples_right", "controls_right", "outside_right")
        )
        goals = {**goals, **LABORATORY_GOALS} if others else LABORATORY_GOALS
    for name, goal in goals.items():
        figure = found[name]
        counted = isinstance(figure, Mapping)
        value = figure["share"] if counted else figure
        total = figure["total"] if counted else found[f"{name}_total"]
        low, high = figure["interval"] if counted else found[f"{name}_interval"]
        # If an end is open, the interval is unbounded.
        ends = [-math.inf if low is None else low, math.inf if high is None else high]
        rows.append(
            {
                "name": name,
                "target": goal.target,
                "at_most": goal.at_most,
                "value": value,
                "total": total,
                "interval": [low, high],
                "reached": None if total == 0 else goal.reached(math.inf if value is None else value),
                "decided": total > 0 and len({goal.reached(end) for end in ends}) == 1,
            }
        )
    return rows
