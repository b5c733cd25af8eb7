"""Words and rows of the score of a blind bench, shared by page, terminal and text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rigsight.report.labels import TIMES, effect_label, listed, percent, sentence_case

NOTHING = "-"
SHARES = {
    "singles_right": "single effects right, gap of 5 x floor and more",
    "singles_right_within_set": "  or named among causes that cannot be distinguished",
    "singles_effect_right": "  effect right, at any place",
    "singles_place_right": "  place right",
    "looked_at": "true places among those examined, gap of 5 x floor and more",
    "pairs_right": "pairs, both right, gap of 10 x floor and more",
    "pairs_right_within_set": "  or named among causes that cannot be distinguished",
    "triples_right": "triples, all three right, gap of 10 x floor and more",
    "triples_right_within_set": "  or named among causes that cannot be distinguished",
    "controls_right": "controls right (none, parameters)",
    "outside_right": "outside the catalogue: unknown, or a similar effect with a remainder",
    "outside_right_large_gap": "  gap of 5 x floor and more",
    "outside_unknown": "  called unknown",
    "outside_named_above_half": "  an effect named with more than 0.5",
    "faint_right": "faint single effects right, 1.5 to 5 x floor",
    "faint_right_within_set": "  or named among causes that cannot be distinguished",
}
NUMBERS = {
    "log_score": "mean log score of clear trials (0 is perfect)",
    "held_out_median": "error on withheld records, median, x floor",
    "seconds_median": "seconds per diagnosis, median",
}
_GOALS = {
    "singles_right": "single effects named",
    "singles_place_right": "place of single effects named",
    "controls_right": "controls recognized (no gap, wrong parameters)",
    "outside_right_large_gap": "effects from outside the catalogue recognized",
    "pairs_right": "pairs, both effects named",
    "triples_right": "triples, all three effects named",
    "log_score": "log score of clear trials, mean (0 is perfect)",
    "held_out_median": "error on withheld records, median",
    "laboratory_right": "effect and place named in laboratory records",
    "laboratory_wrong_name": "another effect or place named there",
    "laboratory_sure_unknown": "called unknown there with more than 0.9",
}
_BESIDE = {
    "singles_effect_right": "single effects named, at whatever place",
    "looked_at": "trials whose true places were examined, on rigs with several places",
    "singles_right_within_set": "single effects named, or among causes that the records cannot distinguish",
    "pairs_right_within_set": "pairs named, or among causes that the records cannot distinguish",
    "triples_right_within_set": "triples named, or among causes that the records cannot distinguish",
    "faint_right": "faint single effects named (gap of 1.5 to 5 noise floors)",
    "faint_right_within_set": "faint single effects named, or among causes that cannot be distinguished",
    "outside_right": "effects from outside recognized, gaps of all sizes",
    "outside_unknown": "effects from outside called unknown",
    "outside_named_above_half": "effects from outside for which an effect was named with more than 0.5",
}
HIDDEN = "Hidden"
_GROUPS = {"kind": "Kind", "tier": "Gap", "noise": "Noise", "rig": "Rig", "effect": HIDDEN}
_TIERS = {
    "below": "below 1.5 noise floors",
    "faint": "1.5 to 5 noise floors (faint)",
    "clear": "5 to 20 noise floors (clear)",
    "strong": "20 noise floors and more (strong)",
}
_TIER_ORDER = (*_TIERS, "not measured", "no effect")


@dataclass(frozen=True)
class GoalRow:
    """One goal: the figure, what it should be, what it is, from how many trials, its interval, and whether it is reached."""

    figure: str
    goal: str
    found: str
    trials: str
    interval: str
    reached: str


@dataclass(frozen=True)
class GroupView:
    """A table of one grouping: what is grouped, and per group the cells of `GROUP_HEADS`."""

    title: str
    rows: dict[str, list[str]]


FAMILY_HEADS = ("Family at its place", "Named", "Trials", "95 % interval", "Probability, mean")
GROUP_HEADS = (
    "Trials", "Right", "95 % interval", "Effect right", "Right or indistinguishable", "Place right", "Place looked at",
    "Log score",
    "Withheld error, median", "Seconds, median",
)  # fmt: skip


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with so many digits; a dash where there is none."""
    return NOTHING if value is None else f"{value:.{digits}g}"


def bench_text(content: Mapping[str, Any]) -> str:
    """Return which benches were scored."""
    return listed(
        f"{b['n_trials']} campaign{'s' if b['n_trials'] != 1 else ''} from an external source"
        if b["design"] == "external"
        else f"{b['n_trials']} of design {b['design']}, seed {b['seed']}"
        for b in content["benches"]
    )


def verdict_text(content: Mapping[str, Any]) -> str:
    """Return whether the goals are reached, in a sentence that names those that are not."""
    rows = content["targets"]
    tried = [row for row in rows if row["reached"] is not None]
    missed = [row for row in tried if not row["reached"]]
    if not tried:
        return "No trial counts towards a goal."
    parts = [
        f"{_GOALS[row['name']]} ({_together(_value(row))} instead of {_together(_target(row))})"
        for row in missed
    ]
    untried = f" {len(rows) - len(tried)} of the goals could not be tested." if len(tried) < len(rows) else ""
    if not missed:
        return f"All of the {len(tried)} goals are reached.{untried}"
    return (
        f"{len(tried) - len(missed)} of {len(tried)} goals are reached. Missed: {'; '.join(parts)}.{untried}"
    )


def _together(text: str) -> str:
    return text.replace(" %", "\u00a0%")


def all_reached(content: Mapping[str, Any]) -> bool:
    """Return True if no goal that could be tried is missed."""
    reached = [row["reached"] for row in content["targets"] if row["reached"] is not None]
    return bool(reached) and all(reached)


def goal_rows(content: Mapping[str, Any]) -> list[GoalRow]:
    """Return the goals, each with the interval of its figure."""
    return [
        GoalRow(
            figure=sentence_case(_GOALS[row["name"]]),
            goal=_target(row),
            found=_value(row),
            trials=_counts(content["goals"][row["name"]], row["total"]),
            interval=_interval(row),
            reached=_reached(row),
        )
        for row in content["targets"]
    ]


def beside_rows(content: Mapping[str, Any]) -> list[list[str]]:
    """Return the figures without a goal: words, share, counts and interval."""
    goals = content["goals"]
    return [[sentence_case(words), *share_cells(goals[name])] for name, words in _BESIDE.items()]


def family_rows(content: Mapping[str, Any]) -> list[list[str]]:
    """Return, by family, how often it was named at its place, of benches with measured rigs."""
    if not any(bench["design"] == "measured" for bench in content["benches"]):
        return []
    return [
        [sentence_case(name.replace("_", " ")), *share_cells(row["right"]), number(row["probability"])]
        for name, row in content["families"].items()
    ]


def share_cells(share: Mapping[str, Any]) -> list[str]:
    """Return share, counts and interval as text."""
    if not share["total"]:
        return [NOTHING, "", ""]
    low, high = share["interval"]
    return [percent(share["share"]), _counts(share, share["total"]), _percent_range(low, high)]


def _counts(figure: Any, total: int) -> str:
    return f"{figure['count']} of {figure['total']}" if isinstance(figure, Mapping) else str(total)


def _percent_range(low: float, high: float) -> str:
    return f"{100.0 * low:.0f} to {100.0 * high:.0f} %"


def _in_percent(row: Mapping[str, Any]) -> bool:
    return row["name"] not in NUMBERS


def _target(row: Mapping[str, Any]) -> str:
    if _in_percent(row):
        return f"{100.0 * row['target']:g} %"
    return (
        f"{row['target']:g} {TIMES} the noise floor"
        if row["name"] == "held_out_median"
        else f"{row['target']:g}"
    )


def _value(row: Mapping[str, Any]) -> str:
    if row["value"] is None:
        return NOTHING if not row["total"] else "endless"
    return percent(row["value"]) if _in_percent(row) else number(row["value"])


def _interval(row: Mapping[str, Any]) -> str:
    if not row["total"]:
        return ""
    low, high = row["interval"]
    if _in_percent(row):
        return _percent_range(low, high)
    return f"{number(low)} to {number(high) if high is not None else 'endless'}"


def _reached(row: Mapping[str, Any]) -> str:
    if row["reached"] is None:
        return "not tried"
    word = "yes" if row["reached"] else "no"
    return word if row["decided"] else f"{word}, but the interval contains the goal"


def reliability_rows(content: Mapping[str, Any]) -> list[list[str]]:
    """Return stated probability, share of right verdicts, counts and interval, of bins that hold a trial."""
    return [
        [number(row["stated"]), *share_cells(row["right"])]
        for row in content["reliability"]
        if row["right"]["total"]
    ]


SCORE_HEADS = (
    "Trials",
    "Stated, mean",
    "True",
    "Log score",
    "Brier score",
    "Slope",
    "Offset",
    "Likely causes contain the true one",
    "Causes in the set",
)


def score_rows(content: Mapping[str, Any]) -> list[list[str]]:
    """Return, for all trials and each stratum, the cells of `SCORE_HEADS` behind its name."""
    return [
        [
            sentence_case(name),
            str(row["count"]),
            number(row["stated"]),
            share_cells(row["true"])[0],
            number(row["log_score"]),
            number(row["brier"]),
            _with_error(row["slope"], row["slope_error"]),
            _with_error(row["offset"], row["offset_error"]),
            share_cells(row["covered"])[0],
            number(row["set_size"]),
        ]
        for name, row in content["probabilities"].items()
    ]


def _with_error(value: float | None, error: float | None) -> str:
    return NOTHING if value is None else f"{value:.2f} \u00b1 {error:.2f}"


def held_out_rows(content: Mapping[str, Any]) -> list[list[str]]:
    """Return, by withheld record, how many there are, median and 95 % quantile of the error."""
    return [_size_cells(name, row) for name, row in content["held_out"]["by_record"].items()]


def parameter_rows(content: Mapping[str, Any]) -> list[list[str]]:
    """Return, by owner of the parameters, count, share within two standard errors, median and 95 % quantile."""
    words = {"all": "All", "rig": "Of the rig"}
    return [
        [
            words.get(name, sentence_case(effect_label(name))),
            str(row["count"]),
            percent(row["within_2"]),
            number(row["median"]),
            number(row["quantile_95"]),
        ]
        for name, row in content["parameters"].items()
    ]


def _size_cells(name: str, row: Mapping[str, Any]) -> list[str]:
    return [sentence_case(name), str(row["count"]), _size(row["median"]), _size(row["quantile_95"])]


def _size(value: float | None) -> str:
    return "endless" if value is None else number(value)


def group_views(content: Mapping[str, Any]) -> list[GroupView]:
    """Return a table for each grouping."""
    return [
        GroupView(
            words,
            {
                _TIERS.get(name, effect_label(name)) if key == "tier" else effect_label(name): _group_cells(
                    row
                )
                for name, row in sorted(content["by"][key].items(), key=lambda item: _order(key, item[0]))
            },
        )
        for key, words in _GROUPS.items()
    ]


def _order(key: str, name: str) -> int:
    return _TIER_ORDER.index(name) if key == "tier" and name in _TIER_ORDER else 0


def _group_cells(row: Mapping[str, Any]) -> list[str]:
    share, counts, interval = share_cells(row["right"])
    return [
        counts.rpartition(" ")[2],
        share,
        interval,
        share_cells(row["effect_right"])[0],
        share_cells(row["right_within_set"])[0],
        share_cells(row["place_right"])[0],
        share_cells(row["looked_at"])[0],
        number(row["log_score"]),
        number(row["held_out_median"]),
        number(row["seconds_median"]),
    ]


def own_versions(content: Mapping[str, Any]) -> Sequence[str]:
    """Return the versions of rigsight that scored, with the number of trials where there are several."""
    counts: Mapping[str, int] = content["scored_by"]
    return list(counts) if len(counts) == 1 else [f"{name}: {count}" for name, count in counts.items()]
