"""The score of a blind bench as one self-contained HTML page: no script, no network, nothing beside the file."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from rigsight.report.page import environment
from rigsight_bench.report import conditions, views
from rigsight_bench.report.confusion import confusion, rows_of_several
from rigsight_bench.report.figures import held_out_figure, reliability_figure
from rigsight_bench.report.wrong_trials import wrong_rows

_MOST_WRONG = 500
"""Wrong trials that a page lists; ``blind.json`` has all."""


def render_blind(content: Mapping[str, Any]) -> str:
    """Return the page of a score.

    Parameters
    ----------
    content
        The content of ``blind.json``.
    """
    right = sum(row["right"]["count"] for row in content["by"]["kind"].values())
    return environment("rigsight_bench.report").get_template("blind.html.jinja").render(
        n_trials=content["n_trials"],
        n_right=right,
        benches=views.bench_text(content),
        reached=views.all_reached(content),
        sentence=views.verdict_text(content),
        goals=views.goal_rows(content),
        beside=views.beside_rows(content),
        condition_heads=conditions.CONDITION_HEADS,
        condition_words=conditions.CONDITION_WORDS,
        conditions=conditions.condition_rows(content),
        family_heads=views.FAMILY_HEADS,
        families=views.family_rows(content),
        held_out_median=views.number(content["goals"]["held_out_median"]),
        seconds={name: views.number(value) for name, value in content["seconds"].items()},
        hours=views.number(content["seconds"]["total"] / 3600.0),
        confusion=confusion(content),
        several=rows_of_several(content),
        reliability=views.reliability_rows(content),
        score_heads=views.SCORE_HEADS,
        scores=views.score_rows(content),
        reliability_plot=reliability_figure(content),
        held_out_plot=held_out_figure(content),
        held_out=views.held_out_rows(content),
        parameters=views.parameter_rows(content),
        group_heads=views.GROUP_HEADS,
        groups=views.group_views(content),
        wrong=wrong_rows(content, _MOST_WRONG),
        n_wrong=len(content["wrong"]),
        scored_by=views.own_versions(content),
        command=content["command"],
        versions=content["versions"],
        seed=", ".join(str(b["seed"]) for b in content["benches"] if b["design"] != "external") or None,
        made=datetime.fromisoformat(content["made"]),
    )  # fmt: skip
