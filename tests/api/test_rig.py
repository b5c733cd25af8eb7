"""A rig declared from Python is the rig of the file with the same words, and every function takes it."""

from __future__ import annotations

import tomllib
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigsight as rs
from rigsight.rigs import RIGS, rig_file_text

T = 5e-3 * np.arange(200)
TRAIN = {"J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}


def declared(name: str) -> dict[str, Any]:
    return tomllib.loads(rig_file_text(name))


@pytest.mark.parametrize("name", RIGS)
def test_words_and_file_declare_the_same_rig(name: str, tmp_path: Path) -> None:
    rig = rs.Rig(**declared(name))
    (tmp_path / "rig.toml").write_text(rig_file_text(name), encoding="utf-8")
    read = rs.Rig.from_file(tmp_path / "rig.toml")
    assert isinstance(read, rs.Rig)
    assert rig == read == deepcopy(rig)
    assert rig.mechanism == RIGS[name].mechanism
    assert rig.declaration == declared(name)


def test_what_is_wrong_is_told_with_its_table() -> None:
    tables = declared("drive_train")
    tables["joints"]["shaft"]["stiffness"] = "k_x"
    with pytest.raises(
        rs.InputError, match=r"Rig 'drive_train': joints\.shaft\.stiffness: 'k_x' is not declared"
    ):
        rs.Rig(**tables)
    with pytest.raises(rs.InputError, match="does not exist"):
        rs.Rig.from_file("nowhere.toml")


def test_every_function_takes_a_rig(tmp_path: Path) -> None:
    rig = rs.Rig(**{**declared("drive_train"), "name": "train"})
    model = rs.make_model(rig, {**TRAIN, "k_3": 30.0}, ["cubic_stiffness@shaft"])
    push = rs.Record("push", T[1], {"u": np.sin(9.0 * T)}, {"u": "A"})
    moved = rs.simulate_model(model, push, {"load_angle": 0.1})
    assert moved["load_angle"][0] == pytest.approx(0.1)
    campaign = rs.make_campaign(rig, [moved], parameters=TRAIN)
    assert campaign.rig.name == campaign.title == "train"
    assert campaign.records[0].units == {"u": "A", "motor_angle": "rad", "load_angle": "rad"}
    table = np.column_stack([T, moved["u"], moved["load_angle"]])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,u,load_angle", comments="")
    read = rs.read_record(tmp_path / "a.csv", rig, constants={"k_t": 0.07})
    assert (list(read.signals), dict(read.constants)) == (["u", "load_angle"], {"k_t": 0.07})


@pytest.mark.slow
def test_estimators_take_records_of_a_rig(campaign: rs.Campaign) -> None:
    records = list(campaign.records)
    fitted = rs.LinearIdentifier(n_jobs=1, rig="axis").fit(records)
    assert fitted.model_.structure.rig is RIGS["axis"]
    with pytest.raises(rs.InputError, match="rig of the records is not given"):
        rs.LinearIdentifier().fit(records)
    with pytest.raises(rs.InputError, match=r"of the rig 'axis', but the estimator has rig='servo'"):
        rs.LinearIdentifier(rig="servo").fit(campaign)
