"""An advised experiment stays within what the rig was driven with."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rigsight.diagnose.advise import _menu
from rigsight.records import Record
from rigsight.rigs import AXIS


@pytest.mark.parametrize(
    "u",
    [
        np.sin(np.arange(400.0)),
        np.where(np.arange(400) < 30, 0.0, 4.0),
        np.where(np.arange(400) < 300, 0.0, -4.0),
        1.0 + 2.0 * np.sin(np.arange(400.0)) ** 2,
    ],
    ids=["sine", "step", "late step down", "to one side"],
)
def test_no_experiment_leaves_the_range_of_the_recorded_input(u: np.ndarray) -> None:
    record = Record("run", 0.01, {"u": u, "x": u}, {"u": "N"})
    menu = list(_menu(SimpleNamespace(rig=AXIS, estimation=(record,), scales={"time": 0.1})))  # type: ignore[arg-type]
    assert "step" in {waveform for (waveform, *_), _ in menu}
    tolerance = 1e-9 * np.ptp(u)
    for _, inputs in menu:
        assert np.min(inputs["u"]) >= np.min(u) - tolerance
        assert np.max(inputs["u"]) <= np.max(u) + tolerance
        assert np.ptp(inputs["u"]) > 0.0
