"""A rig of the user's own from its file to a campaign, a model, a simulation and back."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.errors import InputError
from rigsight.rigs import RIGS, rig_file_text
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate.equations.composition import compose
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.in_memory import make_campaign, make_model
from rigsight.workflow.campaign.model_file import model_of, read_model
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.run.results import json_text
from rigsight.workflow.simulate import run_simulate

from .any_rig import (
    ARM,
    CAMPAIGN,
    CURRENT,
    PENDULUM,
    TORQUES,
    TRAIN,
    T,
    simulated,
    write_record,
    write_train_campaign,
)  # fmt: skip


def model_in(campaign: Campaign) -> Model:
    structure = compose(campaign.rig, campaign.modelled)
    return Model(structure, {**campaign.constants, **campaign.parameters}, "foh")


def test_a_drive_train_goes_round(tmp_path: Path) -> None:
    campaign = read_campaign(write_train_campaign(tmp_path))
    assert [list(record.signals) for record in campaign.records] == [
        ["u", "motor_angle", "load_angle"],
        ["u", "motor_angle"],
    ]
    assert [dict(record.constants) for record in campaign.records] == [{}, {"k_t": 0.06}]
    (tmp_path / "model.json").write_text(json_text(model_in(campaign).to_json()), encoding="utf-8")
    (tmp_path / "train.toml").unlink()
    for record, constants in zip(campaign.records, ({}, {"k_t": 0.06}), strict=True):
        assert record.source is not None
        out = tmp_path / "out.csv"
        run_simulate(tmp_path / "model.json", record.source, out, constants=constants)
        assert out.read_text().splitlines()[0] == "t,u,motor_angle,load_angle"
        found = np.loadtxt(out, delimiter=",", skiprows=1)
        assert np.max(np.abs(found[:, 2] - record["motor_angle"])) < 1e-9 * np.ptp(record["motor_angle"])


def test_an_arm_with_two_inputs_goes_round(tmp_path: Path) -> None:
    record = simulated("two_link_arm", ARM, TORQUES)
    write_record(tmp_path / "a.csv", record, ("tau_2", "angle_2", "tau_1", "angle_1"))
    numbers = "\n".join(f"{name} = {value}" for name, value in ARM.items())
    (tmp_path / "campaign.toml").write_text(
        f'[rig]\nmodel = "two_link_arm"\n[rig.parameters]\n{numbers}\n[[records]]\nfile = "a.csv"\n', "utf-8"
    )
    campaign = read_campaign(tmp_path)
    (tmp_path / "model.json").write_text(json_text(model_in(campaign).to_json()), encoding="utf-8")
    run_simulate(tmp_path / "model.json", tmp_path / "a.csv", tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_text().startswith("t,tau_1,tau_2,angle_1,angle_2\n")
    found = np.loadtxt(tmp_path / "out.csv", delimiter=",", skiprows=1)
    for column, name in enumerate(("tau_1", "tau_2", "angle_1", "angle_2"), 1):
        assert np.max(np.abs(found[:, column] - record[name])) < 1e-9


def test_a_road_that_prescribes_a_motion_goes_round(tmp_path: Path) -> None:
    values = {"m_w": 40.0, "k_b": 2e4, "d_b": 1500.0, "k_t": 2e5, "d_t": 10.0}
    record = simulated("quarter_car", values, {"road": 0.02 * np.sin(6.0 * T) ** 3}, m_b=250.0)
    write_record(tmp_path / "a.csv", record, ("road", "travel", "body"))
    (tmp_path / "model.json").write_text(json_text(make_model("quarter_car", values).to_json()), "utf-8")
    out = tmp_path / "out.csv"
    run_simulate(tmp_path / "model.json", tmp_path / "a.csv", out, constants={"m_b": 250.0})
    assert out.read_text().startswith("t,road,travel,body\n")
    found = np.loadtxt(out, delimiter=",", skiprows=1)
    assert np.max(np.abs(found[:, 3] - record["body"])) < 1e-9 * np.ptp(record["body"])
    np.savetxt(
        tmp_path / "b.csv", np.column_stack([T, record["body"]]), delimiter=",", header="t,body", comments=""
    )
    with pytest.raises(InputError, match="no column 'road'"):
        run_simulate(tmp_path / "model.json", tmp_path / "b.csv", out)


def test_a_model_carries_its_rig() -> None:
    own = rig_of_text(rig_file_text("servo").replace('name = "servo"', 'name = "elbow"'))
    made = make_model(own, {"J": 0.02, "k_v": 3.0, "d": 0.2})
    content = json.loads(json_text(made.to_json()))
    assert content["declaration"]["drives"]["motor"]["signal"] == "clip(k_p*(goal - angle), -1, 1)"
    read = model_of(content)
    assert read.structure.rig is own
    assert read.to_json() == made.to_json()


@pytest.mark.parametrize("name", ["axis", "drive_train"])
def test_a_model_written_before_rigs_were_carried_is_read(name: str) -> None:
    values = {"m": 2.0, "d": 5.0, "k": 8.0} if name == "axis" else TRAIN
    content = make_model(name, values).to_json()
    del content["declaration"]
    assert model_of(content).structure.rig is RIGS[name]


def test_a_built_in_rig_that_is_carried_is_the_built_in_one() -> None:
    assert model_of(make_model("drive_train", TRAIN).to_json()).structure.rig is RIGS["drive_train"]


def test_two_parameters_of_one_name_are_told_apart_by_their_places() -> None:
    effects = ["cubic_stiffness@shaft", "cubic_stiffness@load_bearing"]
    values = {"cubic_stiffness@shaft.k_3": 2.0, "cubic_stiffness@load_bearing.k_3": 3.0}
    made = make_model("drive_train", {**TRAIN, **values}, effects)
    assert made.to_json()["effect_parameters"] == dict(sorted(values.items()))
    assert sorted(made.to_json()["effects"]) == sorted(effects)
    assert model_of(made.to_json()).values == made.values


def test_the_only_place_need_not_be_named() -> None:
    values = {"J": 0.02, "k_v": 3.0, "d": 0.2, "c_2": 0.1}
    assert make_model("servo", values, ["quadratic_damping"]).structure.effect_names == (
        "quadratic_damping@gearbox",
    )
    axis = make_model("axis", {"m": 2.0, "d": 5.0, "k": 8.0, "k_3": 1.0}, ["cubic_stiffness@dynamics"])
    assert axis.structure.effect_names == ("cubic_stiffness",)


def free_motion(folder: Path, rig: str, head: str, record: str = "") -> Campaign:
    (folder / "pendulum.toml").write_text(rig, encoding="utf-8")
    own = rig_of_text(rig)
    swing = simulated(own, {"m": 1.0, "d": 0.01}, {})
    write_record(folder / "a.csv", swing.with_signals(angle=np.cos(6.0 * T)), ("angle",))
    text = f'[rig]\nfile = "pendulum.toml"\n{head}[[records]]\nfile = "a.csv"\n{record}'
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return read_campaign(folder)


def test_a_rig_without_inputs_is_recorded_by_its_sensors_alone(tmp_path: Path) -> None:
    campaign = free_motion(tmp_path, PENDULUM, "[rig.constants]\nm = 1.0\n")
    assert list(campaign.records[0].signals) == ["angle"]


def test_a_constant_may_be_given_by_records_alone(tmp_path: Path) -> None:
    campaign = free_motion(tmp_path, PENDULUM, "", "constants = { m = 0.7 }\n")
    assert campaign.constants == {"m": 0.7}
    assert "Each record has its own m" in campaign.notes[0]
    with pytest.raises(InputError, match=r"rig\.constants\.m: is missing"):
        free_motion(tmp_path, PENDULUM, "")


def test_time_alone_simulates_a_rig_without_inputs(tmp_path: Path) -> None:
    rig = rig_of_text(PENDULUM)
    (tmp_path / "model.json").write_text(json_text(make_model(rig, {"m": 1.0, "d": 0.05}).to_json()), "utf-8")
    np.savetxt(tmp_path / "t.csv", T, header="t", comments="")
    out = tmp_path / "out.csv"
    run_simulate(tmp_path / "model.json", tmp_path / "t.csv", out, initial_state={"angle": 1.0})
    assert out.read_text().startswith("t,angle\n0,1\n")
    angle = np.loadtxt(out, delimiter=",", skiprows=1)[:, 1]
    assert angle[0] == 1.0
    assert angle.min() < -0.5


@pytest.mark.parametrize("name", ["axis", "cart_pendulum"])
def test_start_values_of_a_rig_file_are_where_it_starts(name: str) -> None:
    coordinate, sensor = {"axis": ("x", "x"), "cart_pendulum": ("phi", "angle")}[name]
    rig = rig_of_text(f"{rig_file_text(name)}\n[initial]\n{coordinate} = 0.3\n")
    pendulum = {"m_c": 1.0, "m_p": 0.2, "s": 0.05, "I_p": 0.02, "k_u": 1.0, "d_c": 1.0, "d_p": 0.01}
    values = {"m": 2.0, "d": 5.0, "k": 8.0} if name == "axis" else pendulum
    assert simulated(rig, values, {"u": np.zeros(T.size)})[sensor][0] == 0.3


def test_a_free_motion_needs_no_column_of_the_input(tmp_path: Path) -> None:
    write_train_campaign(tmp_path)
    record = simulated("drive_train", TRAIN, CURRENT)
    write_record(tmp_path / "both.csv", record, ("motor_angle", "load_angle"))
    read = read_campaign(tmp_path).records[0]
    assert not read["u"].any()
    assert "taken as 0 throughout" in read.notes[-1]
    assert read.units["u"] == "A"


def test_a_constant_input_is_given_with_the_record(tmp_path: Path) -> None:
    write_train_campaign(
        tmp_path, CAMPAIGN.replace('file = "both.csv"', 'file = "both.csv"\ninputs = { u = 0.5 }')
    )
    record = simulated("drive_train", TRAIN, CURRENT)
    write_record(tmp_path / "both.csv", record, ("motor_angle", "load_angle"))
    assert set(read_campaign(tmp_path).records[0]["u"]) == {0.5}


def test_a_sensor_that_never_moves_is_left_out_and_said(tmp_path: Path) -> None:
    write_train_campaign(tmp_path)
    record = simulated("drive_train", TRAIN, CURRENT).with_signals(motor_angle=np.zeros(T.size))
    write_record(tmp_path / "both.csv", record, ("u", "motor_angle", "load_angle"))
    read = read_campaign(tmp_path).records[0]
    assert list(read.signals) == ["u", "load_angle"]
    assert "motor_angle never changes" in read.notes[-1]


def test_memory_and_files_hold_the_same_campaign(tmp_path: Path) -> None:
    read = read_campaign(write_train_campaign(tmp_path))
    made = make_campaign(
        read.rig, read.records, parameters=read.parameters, effects=["cubic_stiffness@shaft"]
    )
    assert (made.rig, made.constants, made.parameters) == (read.rig, read.constants, read.parameters)
    assert made.modelled == read.modelled
    with pytest.raises(InputError, match="has none of the outputs motor_angle, load_angle"):
        make_campaign(read.rig, [simulated("axis", {"m": 1.0, "d": 1.0, "k": 1.0}, CURRENT)])


def test_the_same_declaration_is_the_same_rig(tmp_path: Path) -> None:
    campaign = read_campaign(write_train_campaign(tmp_path))
    assert read_campaign(tmp_path).rig is campaign.rig
    (tmp_path / "train.toml").write_text(rig_file_text("drive_train"), encoding="utf-8")
    assert read_campaign(tmp_path).rig is RIGS["drive_train"]
    model = make_model(campaign.rig, TRAIN)
    (tmp_path / "model.json").write_text(json_text(model.to_json()), encoding="utf-8")
    assert read_model(tmp_path).structure.rig is campaign.rig
