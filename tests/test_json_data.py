"""Results as data for JSON: what the standard library cannot write becomes what it can."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

import numpy as np

from rigsight.json_data import json_data


class Answer(StrEnum):
    YES = "yes"


@dataclass(frozen=True)
class Estimate:
    value: float
    interval: tuple[float, float]


def test_results_become_plain_data() -> None:
    content = {
        "estimate": Estimate(np.float64(1.5), (-np.inf, np.nan)),
        "curve": np.array([[1.0, np.nan], [2.0, 3.0]]),
        "answer": Answer.YES,
        "shares": MappingProxyType({"u": np.bool_(True), "y": np.int64(3)}),
    }
    assert json_data(content) == {
        "estimate": {"value": 1.5, "interval": [None, None]},
        "curve": [[1.0, None], [2.0, 3.0]],
        "answer": "yes",
        "shares": {"u": True, "y": 3},
    }


def test_numbers_keep_their_digits() -> None:
    numbers = [0.1, 1e16, 1e-7, 5e-324, 1.7976931348623157e308, -0.0]
    assert json.dumps(json_data({"numbers": numbers})) == json.dumps({"numbers": numbers})
