"""Numbers and effects go back into a robot's model, which then moves as the one that they were taken from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml

from rigsight.effects import effect_named, placed
from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.rigs import RIGS
from rigsight.robots import isaac_settings, load_model, sensor_readings, write_back
from rigsight.robots.draft import draft_rig
from rigsight.robots.runs import gap_of_written
from rigsight.simulate import compose, simulate
from rigsight.simulate.model import Model

ARM = Path(__file__).parent / "models" / "two_link_arm.xml"
STEP = 0.001


def model_of(values: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]) -> Model:
    draft = draft_rig(load_model(ARM), ARM.stem)
    at_places = [placed(effect_named(name.partition("@")[0]), name.partition("@")[2]) for name in effects]
    structure = compose(draft.rig, at_places)
    own = {
        structure.parameter_name(effect, name): value
        for effect in at_places
        for name, value in effects[effect.name].items()
    }
    defaults = {p.name: p.default for p in (*draft.rig.constants, *draft.rig.parameters)}
    return Model(structure, {**defaults, **values, **own}, "zoh")


def run(model: Any, controls: np.ndarray, integrator: str = "RK4") -> np.ndarray:
    """Let MuJoCo run from where the model hangs still; one control for each step."""
    model.opt.integrator = int(getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}"))
    return sensor_readings(model, controls, float(model.opt.timestep))


def sweeping(n: int = 3000) -> np.ndarray:
    t = STEP * np.arange(n)
    return np.column_stack(
        [0.5 * np.sin(2 * np.pi * (0.3 + t) * t), 0.8 * np.sin(2 * np.pi * (0.5 + 0.7 * t) * t)]
    )


def test_the_written_model_moves_as_the_plant_and_the_old_one_does_not(tmp_path: Path) -> None:
    arm = tmp_path / ARM.name
    arm.write_text(ARM.read_text("utf-8").replace('integrator="RK4"', 'integrator="Euler"'), encoding="utf-8")
    text = arm.read_text("utf-8").replace('damping="0.15 0.02 0"', 'damping="0.2 0.02 0" frictionloss="0.12"')
    text = text.replace('kv="0.5"', 'kv="0.5" delay="0.0125" nsample="20" interp="linear"')
    plant = mujoco.MjModel.from_xml_string(text)
    effects = {"coulomb_friction@elbow": {"T_c": 0.12}, "input_delay@shoulder_motor": {"T_d": 0.0125}}
    found = write_back(model_of({"elbow_damping": 0.2}, effects), arm)
    assert found.without_field == ()
    controls = sweeping()
    true, corrected, before = (
        run(model, controls, "Euler")
        for model in (
            plant,
            mujoco.MjModel.from_xml_string(found.text),
            mujoco.MjModel.from_xml_path(str(arm)),
        )
    )
    gap, left = np.std(before - true, axis=0), np.std(corrected - true, axis=0)
    assert np.all(gap > 0.01 * np.std(true, axis=0))
    assert np.all(left < 1e-6 * gap)


@pytest.mark.slow
def test_every_field_is_the_one_that_the_effect_means(tmp_path: Path) -> None:
    """MuJoCo runs what was written as rigsight simulates it; its dry friction gives way a little."""
    fine = tmp_path / ARM.name
    fine.write_text(ARM.read_text("utf-8").replace('timestep="0.001"', 'timestep="0.0002"'), encoding="utf-8")
    effects: dict[str, dict[str, float]] = {
        "coulomb_friction@elbow": {"T_c": 0.12},
        "quadratic_damping@shoulder": {"c_2": 0.05},
        "asymmetric_stiffness@elbow": {"k_2": 0.3},
        "cubic_stiffness@elbow": {"k_3": 0.4},
        "input_delay@shoulder_motor": {"T_d": 0.0125},
        "actuator_lag@elbow_drive": {"T_a": 0.05},
        "input_saturation@elbow_drive": {"u_max": 0.5},
    }
    model = model_of({"elbow_stiffness": 0.8, "shoulder_armature": 0.03, "forearm_mass": 0.5}, effects)
    written = mujoco.MjModel.from_xml_string(write_back(model, fine).text)
    controls = sweeping()
    theirs = run(written, np.repeat(controls, 5, axis=0))[::5, :2]
    start = np.zeros(len(model.structure.states))
    inputs = dict(zip((signal.name for signal in model.structure.rig.inputs), controls.T, strict=True))
    record = Record(
        "sweep", STEP, inputs, {"shoulder_motor_ctrl": "rad", "elbow_drive_ctrl": "N m"}, hold="zoh"
    )
    ours = simulate(model.structure, model.values, record, start)
    for i, name in enumerate(("angle_1", "angle_2")):
        assert np.std(ours[name] - theirs[:, i]) < 1e-2 * np.std(theirs[:, i])


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("torque_ripple", {"T_sin": 0.2, "T_cos": -0.15, "kappa": 7.3}),
        ("presliding_friction", {"T_c": 0.15, "x_p": 0.02}),
        ("lugre_friction", {"T_c": 0.12, "s": 0.8, "w_s": 0.3, "x_p": 0.02}),
    ],
)
def test_what_mujoco_has_in_motors_alone_is_an_idle_motor(
    tmp_path: Path, effect: str, values: Mapping[str, float]
) -> None:
    # MuJoCo reads the state of a motor one step ahead, so that its friction errs with the step.
    fine = tmp_path / ARM.name
    fine.write_text(ARM.read_text("utf-8").replace('timestep="0.001"', 'timestep="0.0002"'), encoding="utf-8")
    model = model_of({}, {f"{effect}@elbow": values})
    found = write_back(model, fine)
    assert found.without_field == ()
    written, before = mujoco.MjModel.from_xml_string(found.text), mujoco.MjModel.from_xml_path(str(fine))
    assert written.nu == before.nu
    controls = sweeping(2000)
    theirs, without = (run(own, np.repeat(controls, 5, axis=0))[::5, :2] for own in (written, before))
    inputs = dict(zip((signal.name for signal in model.structure.rig.inputs), controls.T, strict=True))
    units = {"shoulder_motor_ctrl": "rad", "elbow_drive_ctrl": "N m"}
    record = Record("sweep", STEP, inputs, units, hold="zoh")
    ours = simulate(model.structure, model.values, record, np.zeros(len(model.structure.states)))
    for i, name in enumerate(("angle_1", "angle_2")):
        changed = np.std(without[:, i] - theirs[:, i])
        assert np.std(ours[name] - theirs[:, i]) < 3e-3 * changed


def test_a_filter_that_mujoco_advances_late_is_shorter_by_as_much() -> None:
    model = model_of({}, {"actuator_lag@shoulder_motor": {"T_a": 0.012}})
    controls = sweeping()
    names = [signal.name for signal in model.structure.rig.inputs]
    record = Record("sweep", STEP, dict(zip(names, controls.T, strict=True)), {}, hold="zoh")
    start = np.zeros(len(model.structure.states))
    shown = simulate(model.structure, model.values, record, start)
    measured = record.with_signals(**{s.name: shown[s.name] for s in model.structure.rig.outputs})
    for one in gap_of_written(model, ARM, [measured], [start]):
        assert one.in_mujoco < 1e-3


@pytest.mark.parametrize("integrator", ["RK4", "Euler", "implicitfast"])
def test_a_delay_that_is_no_whole_number_of_steps_is_kept_on_average(tmp_path: Path, integrator: str) -> None:
    arm = tmp_path / ARM.name
    arm.write_text(
        ARM.read_text("utf-8").replace('integrator="RK4"', f'integrator="{integrator}"'), encoding="utf-8"
    )
    step, late = 0.001, 0.0124
    found = write_back(model_of({}, {"input_delay@shoulder_motor": {"T_d": late}}), arm)
    delayed, prompt = mujoco.MjModel.from_xml_string(found.text), mujoco.MjModel.from_xml_path(str(arm))
    reported = sweeping(2000)
    whole = round(late / step)
    shifted = [np.vstack([np.zeros((n, 2)), reported])[: len(reported)] for n in (whole, whole + 1)]
    for controls in shifted:
        controls[:, 1] = reported[:, 1]
    sooner, later = (run(prompt, controls, integrator)[:, 0] for controls in shifted)
    own = run(delayed, reported, integrator)[:, 0]
    # Between the two, and as far from each as 0.4 of a step says.
    share = np.vdot(own - sooner, later - sooner) / np.vdot(later - sooner, later - sooner)
    assert share == pytest.approx(late / step - whole, abs=0.1)


def test_play_of_a_gear_is_a_second_joint_with_a_range(tmp_path: Path) -> None:
    """MuJoCo's limit is a spring beyond the range; that it is one of the stiffness said is seen in how far it gives way."""
    stiff, half = 60.0, 0.03
    draft = draft_rig(load_model(ARM), ARM.stem, gears={"shoulder": stiff})
    play = placed(effect_named("free_play"), "shoulder_gear")
    structure = compose(draft.rig, [play])
    values = {p.name: p.default for p in (*draft.rig.constants, *draft.rig.parameters)}
    found = write_back(Model(structure, {**values, structure.parameter_name(play, "g"): half}, "zoh"), ARM)
    assert found.without_field == ()
    assert any("joint 'shoulder_play' behind 'shoulder'" in one for one in found.written)
    model = mujoco.MjModel.from_xml_string(found.text)
    data = mujoco.MjData(model)
    place = int(model.jnt_qposadr[model.joint("shoulder_play").id])
    # The arm held out by a goal of the shoulder: its weight and the elbow's spring pull on the gear.
    data.ctrl[0] = 1.0
    mujoco.mj_step(model, data, 8000)
    pulling = stiff * (abs(data.qpos[place]) - half)
    weight = abs(data.qfrc_bias[place])
    assert abs(data.qpos[place]) > half
    assert pulling == pytest.approx(weight, rel=0.02)


def test_what_has_no_field_is_said() -> None:
    found = write_back(model_of({}, {"stribeck_friction@elbow": {"T_c": 0.1, "T_s": 0.2, "w_s": 0.1}}), ARM)
    assert found.without_field == ("stribeck_friction at elbow (T_c = 0.1, T_s = 0.2, w_s = 0.1)",)
    assert "MuJoCo has no field for stribeck_friction at elbow" in found.text


def test_a_length_that_differs_from_the_file_is_said_to_have_no_field() -> None:
    found = write_back(model_of({"forearm_at_z": -0.31}, {}), ARM)
    assert (found.written, found.without_field) == ((), ("forearm_at_z = -0.31, -0.3 in the file",))


def test_what_did_not_change_is_not_written() -> None:
    assert write_back(model_of({}, {}), ARM).written == ()


def test_another_robot_is_refused() -> None:
    rig = RIGS["drive_train"]
    model = Model(compose(rig, []), dict.fromkeys(("k_t",), 1.0), "foh")
    with pytest.raises(InputError, match=r"has a joint 'shaft'.*shoulder, elbow"):
        write_back(model, ARM)


def test_isaac_settings_hold_friction_and_delay_of_each_joint() -> None:
    effects = {
        "coulomb_friction@elbow": {"T_c": 0.12},
        "input_delay@shoulder_motor": {"T_d": 0.0125},
        "cubic_stiffness@elbow": {"k_3": 0.4},
    }
    found = isaac_settings(model_of({"shoulder_armature": 0.03}, effects), ARM, step=0.005)
    groups = yaml.safe_load(found.text)["actuators"]
    assert groups["shoulder"] == {
        "joint_names_expr": ["shoulder"],
        "stiffness": 25.0,
        "damping": 0.5,
        "viscous_friction": 0.3,
        "armature": 0.03,
        "actuator_effort_limit": 40.0,
        "min_delay": 2,
        "max_delay": 2,
    }
    # The elbow's motor has no gains; its spring is none that Isaac Lab has.
    assert "stiffness" not in groups["elbow"]
    assert any(one.startswith("elbow_stiffness = ") for one in found.without_field)
    assert (groups["elbow"]["friction"], groups["elbow"]["dynamic_friction"]) == (0.12, 0.12)
    assert any("cubic_stiffness at elbow" in one for one in found.without_field)


def test_a_gain_that_is_written_is_not_listed_as_left_out() -> None:
    found = isaac_settings(model_of({"shoulder_motor_kp": 30.0, "shoulder_motor_kv": 0.6}, {}), ARM)
    group = yaml.safe_load(found.text)["actuators"]["shoulder"]
    assert (group["stiffness"], group["damping"]) == (30.0, 0.6)
    assert not any("_kp" in one or "_kv" in one for one in found.without_field)


@pytest.mark.parametrize(
    ("force_range", "limit", "left_out"),
    [
        ("-40 40", 40.0, []),
        ("-10 40", 40.0, ["shoulder_motor_weakest = -10, unlike the upper end"]),
        ("0 40", 40.0, ["lower limit of shoulder_motor = 0, unlike the upper end"]),
    ],
)
def test_isaac_settings_have_one_limit_for_both_directions(
    force_range: str, limit: float, left_out: list[str], tmp_path: Path
) -> None:
    arm = tmp_path / ARM.name
    text = ARM.read_text(encoding="utf-8").replace('forcerange="-40 40"', f'forcerange="{force_range}"')
    arm.write_text(text, encoding="utf-8")
    draft = draft_rig(load_model(arm), arm.stem)
    values = {p.name: p.default for p in (*draft.rig.constants, *draft.rig.parameters)}
    found = isaac_settings(Model(compose(draft.rig, []), values, "zoh"), arm)
    assert yaml.safe_load(found.text)["actuators"]["shoulder"]["actuator_effort_limit"] == limit
    assert [one for one in found.without_field if "shoulder" in one and "upper" in one] == left_out
    assert all(one in found.text for one in left_out)


@pytest.mark.parametrize(
    ("controls", "dt", "said"),
    [(np.zeros((5, 3)), STEP, "shape"), (np.zeros((5, 2)), 1.5 * STEP, "multiple of the model's step")],
)
def test_controls_that_do_not_fit_are_refused(controls: np.ndarray, dt: float, said: str) -> None:
    with pytest.raises(InputError, match=said):
        sensor_readings(load_model(ARM), controls, dt)


@pytest.mark.parametrize(
    ("effects", "largest"),
    [
        ({"integral_action@shoulder_motor": {"r_i": 3.0}}, 2e-3),
        ({"command_rate_limit@shoulder_motor": {"w_c": 1.0, "T_f": 2e-4}}, 1e-2),
        ({"controller_saturation@shoulder_motor": {"o_max": 0.05}}, 2e-3),
        (
            {
                "integral_action@shoulder_motor": {"r_i": 3.0},
                "command_rate_limit@shoulder_motor": {"w_c": 1.0, "T_f": 2e-4},
            },
            1e-2,
        ),
    ],
    ids=["integral", "rate", "force", "both"],
)
def test_what_a_controller_does_beyond_its_law_moves_the_written_model(
    effects: Mapping[str, Mapping[str, float]], largest: float
) -> None:
    """MuJoCo limits a rate from step to step, which comes half a step late."""
    ours = model_of({}, effects)
    assert write_back(ours, ARM).without_field == ()
    controls = sweeping()
    names = [signal.name for signal in ours.structure.rig.inputs]
    record = Record("sweep", STEP, dict(zip(names, controls.T, strict=True)), {}, hold="zoh")
    start = np.zeros(len(ours.structure.states))
    here = simulate(ours.structure, ours.values, record, start)
    plain = simulate(compose(ours.structure.rig), model_of({}, {}).values, record)
    measured = record.with_signals(**{s.name: here[s.name] for s in ours.structure.rig.outputs})
    for one in gap_of_written(ours, ARM, [measured], [start]):
        assert one.in_mujoco < largest
        assert one.in_model < 1e-4
    assert (
        max(np.std(plain[n] - here[n]) / np.std(here[n]) for n in here.signals if n not in names)
        > 5 * largest
    )


def test_records_of_another_rig_are_refused() -> None:
    ours = model_of({}, {})
    names = [signal.name for signal in ours.structure.rig.inputs]
    still = Record("still", STEP, {name: np.zeros(20) for name in names}, {}, hold="zoh")
    start = np.zeros(len(ours.structure.states))
    with pytest.raises(InputError, match="No record has a reading"):
        gap_of_written(ours, ARM, [still], [start])
    without = Record("without", STEP, {names[0]: np.zeros(20)}, {}, hold="zoh")
    with pytest.raises(InputError, match=f"no signal '{names[1]}'"):
        gap_of_written(ours, ARM, [without], [start])


def test_a_payload_of_a_record_is_written_for_its_run() -> None:
    ours = model_of({}, {})
    payload = next(name for name in ours.values if name.endswith("_mass"))
    heavier = {payload: 1.5 * ours.values[payload]}
    names = [signal.name for signal in ours.structure.rig.inputs]
    record = Record(
        "sweep", STEP, dict(zip(names, sweeping().T, strict=True)), {}, hold="zoh", constants=heavier
    )
    start = np.zeros(len(ours.structure.states))
    moved = simulate(ours.structure, {**ours.values, **heavier}, record, start)
    measured = record.with_signals(**{s.name: moved[s.name] for s in ours.structure.rig.outputs})
    for one in gap_of_written(ours, ARM, [measured], [start]):
        assert one.in_mujoco < 2e-3
    for one in gap_of_written(ours, ARM, [replace(measured, constants={})], [start]):
        assert one.in_mujoco > 1e-2


def test_a_limit_that_the_model_has_already_stays_where_it_is_narrower() -> None:
    wide = model_of({}, {"controller_saturation@shoulder_motor": {"o_max": 100.0}})
    assert write_back(wide, ARM).model.actuator_forcerange[0] == pytest.approx([-40.0, 40.0])
