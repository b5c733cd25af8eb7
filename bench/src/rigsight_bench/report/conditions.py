"""Words and rows for the trials of a laboratory, by the condition under which their records were taken."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rigsight.report.labels import sentence_case
from rigsight_bench.report.views import NUMBERS, SHARES, number

_LABORATORY_SHARES = {
    "laboratory_right": "laboratory: effect and place right",
    "laboratory_wrong_name": "  another effect or place named",
    "laboratory_sure_unknown": "  called unknown with a probability above 0.9",
}
CONDITION_HEADS = (
    "Condition",
    "Trials",
    "Right",
    "Wrong name",
    "Unknown",
    "Neither",
    "Largest stated",
    "Seconds, median",
)
"""Heads of the table by condition; the largest stated probability is that of `unknown`."""
CONDITION_WORDS = (
    "Records as taken in laboratories, by the disturbance of the measurement. Right means that the hidden effect is named at its "
    "place; of three effects, that the one with the largest gap is named, alone or with others of the three. The verdicts none "
    "and parameters and failed diagnoses are not counted. The largest stated probability is that of unknown."
)


def condition_rows(content: Mapping[str, Any]) -> list[list[str]]:
    """Return a row for each condition of a laboratory's trials and one for all; none where there are no such trials."""
    return [
        [
            sentence_case(name.replace("_", " ")),
            str(row["laboratory_right"]["total"]),
            *(
                str(row[figure]["count"])
                for figure in ("laboratory_right", "laboratory_wrong_name", "unknown", "neither")
            ),
            number(row["largest_unknown"]),
            number(row["seconds_median"]),
        ]
        for name, row in content["conditions"].items()
    ]


def screen_shares(content: Mapping[str, Any]) -> dict[str, str]:
    """Return the shares that a terminal shows, with their words: a laboratory's alone where nothing else was tried."""
    if not content["conditions"]:
        return SHARES
    return _LABORATORY_SHARES if _laboratory_alone(content) else {**SHARES, **_LABORATORY_SHARES}


def screen_numbers(content: Mapping[str, Any]) -> dict[str, str]:
    """Return the figures that a terminal shows, with their words."""
    return {"seconds_median": NUMBERS["seconds_median"]} if _laboratory_alone(content) else NUMBERS


def _laboratory_alone(content: Mapping[str, Any]) -> bool:
    return bool(content["conditions"]) and not any(content["goals"][name]["total"] for name in SHARES)
