"""The reference of a closed loop in the records of a campaign."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.identify.closed_loop import closed_loop_notes
from rigsight.records.signals import instrument_of
from rigsight.rigs import rig_file_text
from rigsight.workflow.campaign.read_campaign import read_campaign

from .campaign_text import Lines

AXIS_LOOP = """
[rig]
model = "axis"
[[records]]
file = "sweep.csv"
"""


def loop_campaign(folder: Path, write_csv: Callable[..., Path], text: str = "", **options: Any) -> Path:
    write_csv(**{"header": "t,u,x,goal"} | options)
    (folder / "campaign.toml").write_text(AXIS_LOOP + text, encoding="utf-8")
    return folder


def test_a_record_may_hold_the_reference_of_a_closed_loop(
    tmp_path: Path, write_csv: Callable[..., Path]
) -> None:
    mapped = '[records.columns]\nreference = { name = "goal", unit = "mm" }\n'
    (record,) = read_campaign(loop_campaign(tmp_path, write_csv, mapped)).records
    assert record.slice(10, 60)["reference"][0] == pytest.approx(0.01 * np.cos(0.2))
    assert record.units["reference"] == "mm"
    (by_name,) = read_campaign(loop_campaign(tmp_path, write_csv, header="t,u,x,reference")).records
    np.testing.assert_array_equal(by_name["reference"], record["reference"])
    (without,) = read_campaign(loop_campaign(tmp_path, write_csv)).records
    assert "reference" not in without


def test_a_reference_that_cannot_be_read_is_told_as_other_signals_are(
    tmp_path: Path, write_csv: Callable[..., Path]
) -> None:
    def broken(lines: Lines) -> None:
        lines[20] = lines[20].rpartition(",")[0] + ",abc"

    mapped = '[records.columns]\nreference = "goal"\n'
    with pytest.raises(InputError, match=r"record 1: sweep.csv, line 21.*'goal'"):
        read_campaign(loop_campaign(tmp_path, write_csv, mapped, change=broken))
    with pytest.raises(InputError, match="no column 'gaol'"):
        read_campaign(loop_campaign(tmp_path, write_csv, mapped.replace("goal", "gaol")))
    with pytest.raises(InputError, match=r"columns\.refrence.*Did you mean 'reference'"):
        read_campaign(loop_campaign(tmp_path, write_csv, mapped.replace("reference", "refrence")))


def test_a_rig_whose_own_input_is_called_reference_means_that(
    tmp_path: Path, write_csv: Callable[..., Path]
) -> None:
    own = rig_file_text("servo").replace("goal", "reference").replace('name = "servo"', 'name = "own"')
    (tmp_path / "own.toml").write_text(own, encoding="utf-8")
    write_csv(header="t,reference,angle,other")
    (tmp_path / "campaign.toml").write_text(
        '[rig]\nfile = "own.toml"\n[[records]]\nfile = "sweep.csv"\n', encoding="utf-8"
    )
    campaign = read_campaign(tmp_path)
    (record,) = campaign.records
    names = [signal.name for signal in campaign.rig.inputs]
    assert (names, list(record.signals)) == (["reference"], ["reference", "angle"])
    assert instrument_of(record, names) is None
    assert closed_loop_notes(campaign.records, campaign.rig, "") == []
