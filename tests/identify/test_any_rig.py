"""Sizes, first states and fits of rigs of several motions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.identify.fit.first_states import first_state, state_at_rest
from rigsight.records.record import Record
from rigsight.rigs import RIGS, RUNNING_GEAR, Rig
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

DT = 5e-3
T = DT * np.arange(2000)
TRAIN = {"k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}
SERVO = {"m": 1.0, "l": 0.15, "k_p": 2.0, "J": 0.02, "k_v": 3.0, "d": 0.2, "angle_off": 0.05}
NOISE = 2e-3
DECAY = """
name = "decay"
[constants.g]
unit = "m/s^2"
default = 9.81
[parameters.l]
unit = "m"
lower = 1e-3
log = true
[parameters.d]
unit = "1/s"
lower = 0.0
[coordinates.q]
unit = "rad"
[energy]
kinetic = "l^2*d(q)^2/2*1"
potential = "-g*l*cos(q)"
[joints.pivot]
motion = "q"
damping = "d*l^2"
[sensors.angle]
reads = "q"
unit = "rad"
"""


def rig_of(name: str) -> Rig:
    return RIGS[name]


def made(
    rig: Rig,
    values: Mapping[str, float],
    inputs: Mapping[str, NDArray[np.float64]],
    noise: float = 0.0,
    initial_state: NDArray[np.float64] | None = None,
) -> Record:
    n = len(next(iter(inputs.values()), T))
    signals = dict(inputs) or {"t_only": np.zeros(n)}
    record = simulate(compose(rig), values, Record("run", DT, signals, {}), initial_state)
    rng = np.random.default_rng(1)
    noisy = {s.name: record[s.name] + noise * rng.standard_normal(n) for s in rig.outputs}
    return record.with_signals(**noisy)


def chirp(amplitude: float = 1.0) -> NDArray[np.float64]:
    return amplitude * np.sin(5.0 * T + 2.0 * T**2)


def test_sizes_are_those_of_each_place_whatever_the_order_of_the_sensors() -> None:
    rig = rig_of("drive_train")
    record = made(rig, TRAIN, {"u": chirp()})
    sizes = characteristic_scales(rig, [record], TRAIN)
    twist = record["motor_angle"] - record["load_angle"]
    assert sizes["x@shaft"] == pytest.approx(np.percentile(np.abs(twist - np.median(twist)), 98), rel=0.02)
    assert sizes["force@shaft"] == pytest.approx(TRAIN["k_s"] * sizes["x@shaft"])
    assert sizes["force@load_bearing"] == pytest.approx(TRAIN["k_l"] * sizes["x@load_bearing"])
    assert sizes["drive@motor"] == pytest.approx(TRAIN["k_t"] * sizes["input@motor"])
    speed = np.gradient(record["motor_angle"], DT)
    assert sizes["x@motor_bearing"] / sizes["time@motor_bearing"] == pytest.approx(
        np.percentile(np.abs(speed), 98), rel=0.02
    )
    # The load is moved by what comes through the shaft: inertia, spring and damper balance it.
    assert sizes["drive@load_bearing"] >= sizes["force@load_bearing"]
    assert all(value > 0.0 for value in sizes.values())
    for base in ("x", "force", "drive", "time", "input", "length"):
        for place in ("shaft", "motor_bearing", "load_bearing", "motor", "motor_angle", "load_angle"):
            assert f"{base}@{place}" in sizes
    only_load = Record("run", DT, {"u": record["u"], "load_angle": record["load_angle"]}, {})
    same = characteristic_scales(rig, [only_load], TRAIN)
    assert same["x@shaft"] == pytest.approx(sizes["x@shaft"], rel=0.1)


def test_a_number_that_is_zero_has_the_size_at_which_it_would_matter() -> None:
    rig = rig_of("drive_train")
    values = {**TRAIN, "d_l": 0.0}
    sizes = characteristic_scales(rig, [made(rig, values, {"u": chirp()})], values)
    speed = sizes["x@load_bearing"] / sizes["time@load_bearing"]
    assert 1e-4 < sizes["size@d_l"] * speed / sizes["drive@load_bearing"] < 1e-2
    assert sizes["size@J_m"] == TRAIN["J_m"]
    assert sizes["size@d(phi_m)"] == pytest.approx(sizes["size@phi_m"] / sizes["time@motor_bearing"], rel=0.1)


def test_a_rig_of_one_motion_has_the_same_sizes_at_its_places() -> None:
    values = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0}
    values |= {"psi_off": 1e-3, "l_0": 0.25, "c_y": 0.98, "y_off": -5e-4}
    record = simulate(compose(RUNNING_GEAR), values, Record("run", DT, {"u": chirp()}, {}))
    sizes = characteristic_scales(RUNNING_GEAR, [record], values)
    for base in ("x", "force", "drive", "time"):
        assert sizes[f"{base}@yaw_dynamics"] == sizes[base]
        assert sizes[f"{base}@actuator"] == sizes[base]
    assert (sizes["input@actuator"], sizes["x@psi"]) == (sizes["input"], sizes["x"])
    assert sizes["x@y"] == sizes["length@y"] == sizes["length"]


def test_the_first_state_is_that_of_the_first_samples() -> None:
    rig = rig_of("drive_train")
    begin = np.array([0.3, 0.25, 2.0, -1.0])
    soft = {**TRAIN, "k_s": 0.02, "k_l": 0.02}
    record = made(rig, soft, {"u": np.zeros_like(T)}, initial_state=begin)
    found = first_state(compose(rig), record, soft)
    # A line through seven samples has the slope in their middle.
    twisting = 0.02 * 0.05 + 1e-3 * 3.0
    bend = 3.0 * DT * (twisting + 1e-3 * 2.0) / 1e-4
    assert found[:2] == pytest.approx(begin[:2], abs=bend * DT)
    assert found[2:] == pytest.approx(begin[2:], abs=bend)


def test_what_no_sensor_tells_is_that_of_the_equilibrium() -> None:
    rig = rig_of("drive_train")
    record = made(rig, TRAIN, {"u": np.full_like(T, 2.0)})
    found = first_state(compose(rig), Record("run", DT, {"u": record["u"]}, {}), TRAIN)
    assert found == pytest.approx([0.05 * 2.0 / 0.5 + 0.05, 0.05 * 2.0 / 0.5, 0.0, 0.0], abs=1e-6)


def test_a_reading_that_stands_beside_its_coordinate_tells_it() -> None:
    rig = rig_of("servo")
    record = made(rig, SERVO, {"goal": np.full_like(T, 0.4)})
    found = first_state(compose(rig), record, SERVO)
    assert found == pytest.approx([record["angle"][0] + 0.05, 0.0], abs=1e-4)
    rest = state_at_rest(compose(rig), record, found + 1.0, SERVO)
    assert rest == pytest.approx([np.mean(record["angle"]) + 0.05, 0.0], abs=1e-4)


def test_a_fit_finds_a_drive_train_from_records_that_lack_sensors() -> None:
    rig = rig_of("drive_train")
    both = made(rig, TRAIN, {"u": chirp()}, NOISE)
    motor = Record("motor", DT, {n: both[n] for n in ("u", "motor_angle")}, {})
    other = made(rig, TRAIN, {"u": chirp(2.0)[::-1]}, NOISE)
    load = Record("load", DT, {n: other[n] for n in ("u", "load_angle")}, {})
    start = {**TRAIN, "J_m": 1.1e-4, "J_l": 4.8e-4, "k_s": 1.9, "k_l": 0.51}
    records = [motor, load]
    noise = {"motor_angle": NOISE, "load_angle": NOISE}
    fit = GreyBoxFit(compose(rig), records, characteristic_scales(rig, records, start), noise)
    found = fit.fit(start, [p.name for p in rig.parameters])
    assert found.weighted_rms == pytest.approx(1.0, abs=0.05)
    for name in ("J_m", "J_l", "k_s", "k_l"):
        assert abs(found.values[name] - TRAIN[name]) < 5.0 * found.standard_errors[name]


def test_what_only_decays_needs_no_input() -> None:
    rig = rig_of_text(DECAY, check_units=False)
    truth = {"l": 0.4, "d": 0.2}
    record = made(rig, truth, {}, NOISE, initial_state=np.array([1.2, 0.0]))
    assert np.ptp(record["angle"]) > 1.5
    start = {"g": 9.81, "l": 0.41, "d": 0.3}
    scales = characteristic_scales(rig, [record], start)
    found = GreyBoxFit(compose(rig), [record], scales, {"angle": NOISE}).fit(start, ["l", "d"])
    assert found.weighted_rms == pytest.approx(1.0, abs=0.05)
    assert found.values["l"] == pytest.approx(0.4, rel=1e-3)


def test_records_of_known_different_payload_are_fitted_together() -> None:
    rig = rig_of("servo")
    noise = 1e-3
    records = []
    for index, payload in enumerate((0.5, 1.0, 1.8)):
        clean = made(rig, {**SERVO, "m": payload}, {"goal": np.roll(chirp(0.6), 100 * index)}, noise)
        records.append(Record(f"run {index}", DT, clean.signals, {}, constants={"m": payload}))
    start = {**SERVO, "J": 0.024, "k_v": 2.7, "d": 0.25, "angle_off": 0.0, "m": 7.0}
    fit = GreyBoxFit(compose(rig), records, characteristic_scales(rig, records, start), {"angle": noise})
    found = fit.fit(start, [p.name for p in rig.parameters])
    assert found.weighted_rms == pytest.approx(1.0, abs=0.03)
    for name in ("J", "k_v", "d", "angle_off"):
        assert abs(found.values[name] - SERVO[name]) < 5.0 * found.standard_errors[name]
    # Each is simulated with its own payload; that of the campaign, 7 kg, belongs to none.
    shown = simulate(compose(rig), found.values, records[0], found.initial_states[0])
    assert np.std(shown["angle"] - records[0]["angle"]) == pytest.approx(noise, rel=0.05)


def test_a_constant_that_the_rig_does_not_have_is_refused() -> None:
    rig = rig_of("servo")
    record = Record("run", DT, {"goal": chirp()}, {}, constants={"payload": 1.0})
    with pytest.raises(InputError, match=r"'run': constant.*'payload'"):
        simulate(compose(rig), SERVO, record)
