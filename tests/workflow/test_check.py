"""`rigsight check` from the files of a campaign: its two results, and what is wrong with all records at once."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from .slider import SLIDER

Run = Callable[..., tuple[int, str, str]]


def test_a_check_leaves_a_page_and_the_same_as_json(axis_campaign: Path, tmp_path: Path, run: Run) -> None:
    code, stdout, stderr = run("check", axis_campaign, "-o", tmp_path / "out", "--json")
    assert code == 0, stderr
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["check.html", "check.json"]
    assert json.loads(stdout) == json.loads((tmp_path / "out/check.json").read_text())


def test_every_record_that_cannot_be_read_is_reported(axis_campaign: Path, tmp_path: Path, run: Run) -> None:
    folder = tmp_path / "campaign"
    shutil.copytree(axis_campaign.parent if axis_campaign.is_file() else axis_campaign, folder)
    broken = sorted(folder.glob("*.csv"))[:2]
    for file in broken:
        file.write_text("nothing\n")
    code, _, stderr = run("check", folder, "-o", tmp_path / "out")
    assert code == 2
    assert all(file.name in stderr for file in broken)
    assert not (tmp_path / "out").exists()


def test_a_rig_file_is_checked_before_there_are_records(tmp_path: Path, run: Run) -> None:
    (tmp_path / "slider.toml").write_text(SLIDER)
    code, stdout, stderr = run("check", tmp_path / "slider.toml", "-o", tmp_path / "out", "--json")
    assert code == 0, stderr
    found = json.loads(stdout)
    assert {p["name"]: p["status"] for p in found["parameters"]} == dict.fromkeys("mkd", "determined")
    assert any(
        own["effect"] == "coulomb_friction" and own["visible"] == "yes" for own in found["effects"]["judged"]
    )


def test_a_rig_file_without_numbers_is_refused(tmp_path: Path, run: Run) -> None:
    (tmp_path / "slider.toml").write_text(SLIDER.replace("default = 800.0", ""))
    code, _, stderr = run("check", tmp_path / "slider.toml", "-o", tmp_path / "out")
    assert code == 2
    assert "slider.toml" in stderr
    assert not (tmp_path / "out").exists()


CASES = {
    "angle_wraps": "unwrapped",
    "csv_two_time_columns": "clocks of their own",
    "fit_started_at_a_bound": "T_c",
    "hdf5_packed_integers": "stored number",
    "matlab_two_scopes": "clocks of their own",
    "self_excited": "does not decay",
    "sensor_held_over_ten_rows": "every 10 rows",
    "tdms_two_stamp_channels": "clocks of their own",
    "tdms_two_start_times": "clocks of their own",
    "units_in_second_header_row": "units",
    "unstable_in_closed_loop": "unstable",
}
"""Inputs that went wrong, and a word of the finding on each."""


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_inputs_that_went_wrong_are_found(case: str, shared_data: Path, tmp_path: Path, run: Run) -> None:
    folder = shared_data.parent / "cases" / case
    if not folder.is_dir():
        pytest.skip(f"the inputs that went wrong are not at {folder}")
    code, stdout, stderr = run("check", folder, "-o", tmp_path, "--json", "--effect", "coulomb_friction")
    assert code == 0, stderr
    assert any(CASES[case] in finding["sentence"] for finding in json.loads(stdout)["findings"])


def test_a_code_for_no_reading_is_refused(shared_data: Path, tmp_path: Path, run: Run) -> None:
    folder = shared_data.parent / "cases/sentinel_values"
    if not folder.is_dir():
        pytest.skip(f"the inputs that went wrong are not at {folder}")
    code, _, stderr = run("check", folder, "-o", tmp_path)
    assert code == 2
    assert "e38.csv, column 'x'" in stderr
