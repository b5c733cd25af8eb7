"""A campaign written from files for a rig that is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.rigs import rig_file_text
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.init import run_init

from ...records.formats.files import write_text
from .sweep_of_columns import ANSWER, SWEEP, T


def own_train(folder: Path) -> Path:
    path = folder / "train.toml"
    path.write_text(rig_file_text("drive_train").replace('name = "drive_train"', 'name = "train"'), "utf-8")
    return path


def test_columns_are_matched_to_the_signals_of_the_rig_that_is_named(tmp_path: Path) -> None:
    odd = {
        "Zeit [ms]": 1e3 * T,
        "Strom [mA]": 1e3 * SWEEP,
        "Angle of load [deg]": np.rad2deg(ANSWER),
        "Motor": ANSWER,
    }
    write_text(tmp_path / "a.csv", odd, {})
    draft = run_init(tmp_path, model="drive_train")
    assert draft.n_blanks == 1
    text = draft.path.read_text(encoding="utf-8")
    assert 'motor_angle = "FILL IN"  # [rad], may be: "Motor"' in text
    draft.path.write_text(text.replace('"FILL IN"', '"Motor"'), encoding="utf-8")
    (record,) = read_campaign(tmp_path).records
    np.testing.assert_allclose(record["u"], SWEEP, rtol=1e-12)
    np.testing.assert_allclose(record["load_angle"], ANSWER, rtol=1e-12)


def test_a_sensor_that_was_not_recorded_stays_a_comment(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, "load_angle": ANSWER, "Temp": 2.0 * ANSWER}, {})
    draft = run_init(tmp_path, model="drive_train")
    assert draft.n_blanks == 0
    assert '# motor_angle =    # [rad], one of: "Temp"; or not recorded here' in draft.path.read_text("utf-8")
    assert list(read_campaign(tmp_path).records[0].signals) == ["u", "load_angle"]


def test_a_rig_of_ones_own_is_named_by_its_file(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, "motor_angle": ANSWER, "load_angle": ANSWER}, {})
    draft = run_init(tmp_path, rig_files=[own_train(tmp_path)])
    assert draft.model == "train"
    assert 'file = "train.toml"' in draft.path.read_text(encoding="utf-8")
    assert read_campaign(tmp_path).rig.name == "train"


def test_a_rig_file_that_is_given_is_taken_whatever_the_channels_are_called(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, "x": ANSWER}, {})
    draft = run_init(tmp_path, rig_files=[own_train(tmp_path)])
    assert (draft.model, draft.others) == ("train", ())


def test_a_constant_keeps_all_its_digits(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, "motor_angle": ANSWER, "load_angle": ANSWER}, {})
    file = own_train(tmp_path)
    file.write_text(file.read_text().replace("default = 0.05", "default = 0.0512345678", 1))
    run_init(tmp_path, rig_files=[file])
    assert read_campaign(tmp_path).constants == {"k_t": 0.0512345678}


def test_a_rig_file_elsewhere_is_copied_into_the_campaign(tmp_path: Path) -> None:
    (tmp_path / "records").mkdir()
    write_text(tmp_path / "records" / "a.csv", {"t": T, "u": SWEEP, "motor_angle": ANSWER}, {})
    file = own_train(tmp_path)
    copy = tmp_path / "records" / file.name
    copy.write_text("another")
    with pytest.raises(InputError, match=r"differs from .*, which would be copied there"):
        run_init(tmp_path / "records", model="train", rig_files=[file])
    assert not (tmp_path / "records" / "campaign.toml").exists()
    copy.unlink()
    run_init(tmp_path / "records", model="train", rig_files=[file])
    assert copy.read_text() == file.read_text()
    assert read_campaign(tmp_path / "records").rig.name == "train"
