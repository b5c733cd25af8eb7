"""The score of a blind bench as Markdown: figures, intervals, goals and wrong trials, as the run left them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rigsight_bench.report import conditions, views
from rigsight_bench.report.confusion import confusion, rows_of_several
from rigsight_bench.report.wrong_trials import wrong_rows

_MOST_WRONG = 100
"""Wrong trials that the text lists; ``blind.json`` has all."""


def blind_markdown(content: Mapping[str, Any]) -> str:
    """Return the text of a score.

    Parameters
    ----------
    content
        The content of ``blind.json``.
    """
    seconds = content["seconds"]
    parts = [
        "# The blind bench",
        f"Diagnoses of {content['n_trials']} rigs with hidden effects ({views.bench_text(content)}), scored with keys that no "
        f"diagnosis has seen. The command writes this text; every figure comes from the run.",
        f"- Date: {content['made'].replace('T', ' ').removesuffix('+00:00')} UTC\n"
        f"- Command: `{content['command']}`\n"
        f"- Versions: {', '.join(f'{name} {version}' for name, version in content['versions'].items())}\n"
        f"- Scored by rigsight {', '.join(views.own_versions(content))}\n"
        f"- Time of a diagnosis: {views.number(seconds['median'])} s (median), {views.number(seconds['quantile_95'])} s (95 % "
        f"quantile), {views.number(seconds['total'] / 3600.0)} h in all",
        "## Goals",
        f"{views.verdict_text(content)} Goals apply to gaps of at least 5 noise floors, 10 for several effects; "
        f"intervals are 95 % (Wilson for shares, normal for the mean, order statistics for the median).",
        _table(
            ["Figure", "Goal", "Found", "Trials", "95 % interval", "Reached"],
            [[r.figure, r.goal, r.found, r.trials, r.interval, r.reached] for r in views.goal_rows(content)],
        ),
        "Beside the goals:",
        _table(["Figure", "Found", "Trials", "95 % interval"], views.beside_rows(content)),
        *_conditions(content),
        *_families(content),
        "## True causes and diagnosed causes",
    ]
    if rows := _confusion_rows(content):
        parts.append(_table(["Hidden", "Trials", "Right", "Named instead"], rows))
    for title, outcomes in rows_of_several(content).items():
        parts += [
            f"{title}, gaps of all sizes:",
            _table(["Outcome", "Trials"], [[words, str(count)] for words, count in outcomes]),
        ]
    parts += [
        "## Are the stated probabilities calibrated?",
        _table(["Stated, mean", "True", "Trials", "95 % interval"], views.reliability_rows(content)),
        "By stratum. Slope of the logistic regression of the outcome on the stated log odds: 1 is calibrated, below 1 "
        "overconfident. Offset of the log odds: below 0 if too much is stated on average. The set of likely causes should "
        "contain the true cause in 90 % of the trials.",
        _table(["Stratum", *views.SCORE_HEADS], views.score_rows(content)),
        "## Errors on withheld records",
        "In noise floors, simulated from the model and the input alone, by kind and amplitude of the record; all trials except "
        "those with an effect from outside the catalogue.",
        _table(["Record", "Records", "Median", "95 % quantile"], views.held_out_rows(content)),
        "## Errors of the parameters",
        "In standard errors, where the verdict is right. Correct standard errors would give 95 % within 2, a median of 0.67 and "
        "a "
        "95 % quantile of 1.96.",
        _table(
            ["Parameters", "Numbers", "Within 2", "Median", "95 % quantile"], views.parameter_rows(content)
        ),
        "## By kind, gap, noise and rig",
        *(
            _table([view.title, *views.GROUP_HEADS], [[name, *cells] for name, cells in view.rows.items()])
            for view in views.group_views(content)
            if view.title != views.HIDDEN
        ),
        "## Wrong trials",
        _wrong(content),
    ]
    return "\n\n".join(parts) + "\n"


def _families(content: Mapping[str, Any]) -> list[str]:
    rows = views.family_rows(content)
    return ["## Known causes in measured records", _table(list(views.FAMILY_HEADS), rows)] if rows else []


def _conditions(content: Mapping[str, Any]) -> list[str]:
    rows = conditions.condition_rows(content)
    if not rows:
        return []
    return [
        "## By condition of the laboratory",
        conditions.CONDITION_WORDS,
        _table(conditions.CONDITION_HEADS, rows),
    ]


def _confusion_rows(content: Mapping[str, Any]) -> list[list[str]]:
    found = confusion(content)
    rows = []
    for truth, cells in found.rows.items():
        right = sum(cell.count for cell in cells if cell.right)
        instead = [
            f"{name} ({cell.count})"
            for name, cell in zip(found.heads, cells, strict=True)
            if cell.count and not cell.right
        ]
        rows.append([truth, str(sum(cell.count for cell in cells)), str(right), ", ".join(instead)])
    return rows


def _wrong(content: Mapping[str, Any]) -> str:
    if not content["wrong"]:
        return "None."
    rows = wrong_rows(content, _MOST_WRONG)
    table = _table(
        ["Trial", "Hidden", "Named", "Gap", "Stated", "On the truth", "Withheld error", "Remark"],
        [
            [r.trial, r.hidden, r.named, r.gap, r.stated, r.on_truth, r.held_out, r.remark.split("\n")[0]]
            for r in rows
        ],
    )
    more = len(content["wrong"]) - len(rows)
    again = f"Each trial can be rerun alone, the first with `{rows[0].again}`."
    return "\n\n".join([table, *([f"And {more} more in blind.json."] if more else []), again])


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(_cell(cell) for cell in line)} |" for line in lines)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
