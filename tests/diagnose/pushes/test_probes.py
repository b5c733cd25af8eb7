"""A push is what an input or a torque would be, and an effect by itself is its declared law."""

from __future__ import annotations

import numpy as np

from rigsight.diagnose.pushes.probes import (
    PUSH_SIZE,
    STIFFNESS,
    alone,
    motion_columns,
    push,
    signal_columns,
    with_probes,
)
from rigsight.discover.terms import known_terms
from rigsight.effects import effect_named, placed
from rigsight.records.record import Record
from rigsight.rigs import RIGS
from rigsight.simulate import compose, simulate

TRAIN = RIGS["drive_train"]
VALUES = {
    "k_t": 0.05,
    "J_m": 1e-4,
    "J_l": 5e-4,
    "k_s": 0.4,
    "d_s": 1e-3,
    "d_m": 5e-4,
    "d_l": 1e-3,
    "k_l": 0.1,
}
DT, N = 5e-3, 600
T = DT * np.arange(N)
PROBED = compose(with_probes(TRAIN))


def shown(size: float = 1.0, **inputs: np.ndarray) -> np.ndarray:
    rest = {signal.name: np.zeros(N) for signal in PROBED.rig.inputs}
    record = Record("pushed", DT, {**rest, **inputs}, {})
    out = simulate(PROBED, {**VALUES, PUSH_SIZE: size}, record)
    return np.column_stack([out[signal.name] for signal in PROBED.rig.outputs])


def test_pushes_add_to_what_a_drive_is_told_and_to_what_a_sensor_shows() -> None:
    wave = np.sin(7.0 * T)
    reported = shown(u=wave)
    np.testing.assert_allclose(shown(2.0, **{push("motor"): 0.5 * wave})[:, :2], reported[:, :2], atol=1e-9)
    biased = shown(0.5, u=wave, **{push("load_angle"): 2.0 * wave})
    np.testing.assert_allclose(biased[:, 1] - reported[:, 1], wave, atol=1e-9)
    np.testing.assert_allclose(biased[:, 0], reported[:, 0], atol=1e-12)


def test_a_push_at_a_joint_acts_along_its_motion() -> None:
    wave = np.sin(7.0 * T)
    by_drive = shown(u=wave)
    np.testing.assert_allclose(
        shown(**{push("motor_bearing"): VALUES["k_t"] * wave})[:, :2], by_drive[:, :2], atol=1e-9
    )
    # Equal and opposite: on the motor forward, on the load back.
    apart = shown(**{push("motor_bearing"): wave, push("load_bearing"): -wave})
    np.testing.assert_allclose(shown(**{push("shaft"): wave})[:, :2], apart[:, :2], atol=1e-7)


def test_a_push_at_a_joint_shows_in_a_sensor_of_its_force() -> None:
    element = RIGS["element"]
    probed, wave = compose(with_probes(element)), np.sin(7.0 * T)
    rest = {signal.name: np.zeros(N) for signal in probed.rig.inputs}
    known = {"d": 0.4, "k": 20.0, "force_off": 0.0, PUSH_SIZE: 1.0}

    def force(**inputs: np.ndarray) -> np.ndarray:
        return simulate(probed, known, Record("pushed", DT, {**rest, **inputs}, {}))["force"]

    np.testing.assert_allclose(force(x=wave) - force(x=wave, **{push("dynamics"): wave}), wave, atol=1e-9)


def test_motions_and_signals_are_shown_behind_the_readings() -> None:
    out = shown(u=np.sin(7.0 * T))
    np.testing.assert_allclose(out[:, motion_columns(TRAIN)["shaft"]], out[:, 0] - out[:, 1], atol=1e-12)
    np.testing.assert_allclose(out[:, signal_columns(TRAIN)["motor"]], np.sin(7.0 * T), atol=1e-12)


def test_an_effect_by_itself_is_its_law() -> None:
    x = 0.3 * np.sin(2.0 * T)
    structure, column = alone(placed(effect_named("cubic_stiffness"), "shaft"))
    out = simulate(structure, {STIFFNESS: 2.0, "k_3": 5.0}, Record("moved", DT, {"moved": x}, {}))
    force = out[structure.rig.outputs[column].name]
    np.testing.assert_allclose(force, 2.0 * x + 5.0 * x**3, atol=1e-6)
    structure, column = alone(placed(effect_named("input_saturation"), "motor"))
    out = simulate(structure, {"u_max": 0.1}, Record("reported", DT, {"signal": x}, {}))
    np.testing.assert_allclose(out[structure.rig.outputs[column].name], np.clip(x, -0.1, 0.1), atol=1e-12)


def test_a_law_of_what_the_drives_push_is_shown_by_itself() -> None:
    x, pushed = 0.3 * np.sin(2.0 * T), np.cos(3.0 * T)
    structure, column = alone(placed(known_terms()["drive_x1_v0"], "motor_bearing"))
    moved = Record("moved", DT, {"moved": x, "carried": pushed}, {})
    out = simulate(structure, {STIFFNESS: 2.0, "b_10": -0.5}, moved)
    force = out[structure.rig.outputs[column].name]
    np.testing.assert_allclose(force, 2.0 * x + 0.5 * x * pushed, atol=1e-6)


def test_a_push_beside_a_late_drive_needs_no_history() -> None:
    """The command and the push arrive late together, so that sets of parameters still run side by side."""
    late = compose(with_probes(TRAIN), [placed(effect_named("input_delay"), TRAIN.mechanism.drives[0].name)])
    assert late.late_inputs is not None
    assert {own.index for own in late.late_inputs} == {
        late.rig.mechanism.inputs.index("u"),
        late.rig.mechanism.inputs.index(push(TRAIN.mechanism.drives[0].name)),
    }
    u = np.sin(3.0 * T)
    rest = {signal.name: np.zeros(N) for signal in late.rig.inputs}
    values = {**VALUES, PUSH_SIZE: 1.0}
    column = push(TRAIN.mechanism.drives[0].name)
    shifted = np.r_[np.zeros(4), u[:-4]]
    found = simulate(late, {**values, "T_d": 4 * DT}, Record("late", DT, {**rest, "u": u, column: u}, {}))
    expected = simulate(PROBED, values, Record("later", DT, {**rest, "u": shifted, column: shifted}, {}))
    for sensor in TRAIN.outputs:
        np.testing.assert_allclose(found[sensor.name], expected[sensor.name], atol=1e-8)
