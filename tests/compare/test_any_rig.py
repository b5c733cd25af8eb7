"""Models of rigs of several motions and inputs side by side: every input and every sensor that a record holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from rigsight.compare import Competitor, Floor, RecordComparison, Yardstick, compare_on_record, signal_paths
from rigsight.effects import effect_named, placed
from rigsight.excitation import linear_sweep
from rigsight.records import Record
from rigsight.rigs import RIGS
from rigsight.simulate import Structure, compose, simulate
from rigsight.simulate.model import Model

DT, N = 5e-3, 4000
T = DT * np.arange(N)
NOISE = 1e-3
TRAIN = {"k_t": 0.05, "J_m": 1e-3, "J_l": 3e-3, "k_s": 2.0, "d_s": 2e-3, "d_m": 4e-3, "d_l": 4e-3, "k_l": 1.0}
ARM = {
    "l_1": 0.3,
    "g": 9.81,
    "I_1": 0.05,
    "I_2": 0.02,
    "m_2": 0.6,
    "s_1": 0.12,
    "s_2": 0.08,
    "d_1": 0.05,
    "d_2": 0.02,
}


def structure_of(rig: str, *effects: str) -> Structure:
    parts = (name.partition("@") for name in effects)
    return compose(RIGS[rig], [placed(effect_named(kind), place) for kind, _, place in parts])


def measured(model: Model, inputs: dict[str, np.ndarray], sensors: tuple[str, ...], **fields) -> Record:
    """A record of what a model does, with white noise in the sensors that it holds."""
    rng = np.random.default_rng(3)
    rig = model.structure.rig
    units = {signal.name: signal.unit for signal in (*rig.inputs, *rig.outputs)}
    out = simulate(model.structure, model.values, Record("run", DT, inputs, units, hold="foh", **fields))
    noisy = {name: out[name] + NOISE * np.std(out[name]) * rng.normal(size=N) for name in sensors}
    return replace(out, signals={**inputs, **noisy})


def compared(rig: str, record: Record, **models: Model) -> RecordComparison:
    floors = tuple(
        Floor(signal.name, signal.unit, NOISE * float(np.std(record[signal.name])), "known")
        for signal in RIGS[rig].outputs
        if signal.name in record
    )
    competitors = [Competitor(name, model, name) for name, model in models.items()]
    return compare_on_record(competitors, record, [record], Yardstick(RIGS[rig], floors))


def errors(comparison: RecordComparison, model: str, quantity: str) -> dict[str, float]:
    return {
        s.column.signal: s.value
        for s in comparison.scores
        if s.model == model and s.column.quantity == quantity
    }


def test_paths_are_every_input_to_every_sensor() -> None:
    assert [path.name for path in signal_paths(RIGS["two_link_arm"])] == [
        "tau_1 -> angle_1", "tau_1 -> angle_2", "tau_2 -> angle_1", "tau_2 -> angle_2"
    ]  # fmt: skip
    assert [path.is_commanded for path in signal_paths(RIGS["quarter_car"])] == [False, False]


def test_the_model_with_the_friction_of_the_load_is_at_the_floor_and_the_linear_one_is_not() -> None:
    truth = Model(structure_of("drive_train", "coulomb_friction@load_bearing"), {**TRAIN, "T_c": 0.02}, "foh")
    record = measured(
        truth, {"u": linear_sweep(T, 1.0, 2.0, 80.0)}, ("motor_angle", "load_angle"), kind="sweep"
    )
    comparison = compared(
        "drive_train", record, truth=truth, linear=Model(structure_of("drive_train"), TRAIN, "foh")
    )
    assert not comparison.failures
    assert set(comparison.measured) == {"u -> motor_angle", "u -> load_angle"}
    for sensor, error in errors(comparison, "truth", "free_run_nrmse").items():
        assert error == pytest.approx(NOISE, rel=0.1)
        assert errors(comparison, "linear", "free_run_nrmse")[sensor] > 100.0 * error
    for path, error in errors(comparison, "truth", "magnitude_db").items():
        assert errors(comparison, "linear", "magnitude_db")[path] > 5.0 * error


def test_a_sensor_that_a_record_lacks_is_left_out() -> None:
    model = Model(structure_of("drive_train"), TRAIN, "foh")
    record = measured(model, {"u": linear_sweep(T, 1.0, 2.0, 80.0)}, ("load_angle",), kind="sweep")
    comparison = compared("drive_train", record, same=model)
    assert set(comparison.measured) == {"u -> load_angle"}
    assert errors(comparison, "same", "free_run_nrmse") == {"load_angle": pytest.approx(NOISE, rel=0.1)}


@pytest.mark.slow
def test_inputs_that_move_at_once_are_told_apart() -> None:
    rng = np.random.default_rng(1)
    low = butter(3, 0.1)
    torques = {f"tau_{i}": size * lfilter(*low, rng.normal(size=N)) for i, size in ((1, 0.05), (2, 0.02))}
    truth, light = (
        Model(structure_of("two_link_arm"), ARM, "foh"),
        Model(structure_of("two_link_arm"), {**ARM, "I_2": 0.03}, "foh"),
    )
    comparison = compared(
        "two_link_arm", measured(truth, torques, ("angle_1", "angle_2")), truth=truth, light=light
    )
    assert not comparison.failures
    assert set(comparison.measured) == {path.name for path in signal_paths(RIGS["two_link_arm"])}
    own = errors(comparison, "truth", "magnitude_db")
    assert len(own) == 4
    for path, error in errors(comparison, "light", "magnitude_db").items():
        assert error > 3.0 * own[path]


def test_a_step_is_that_of_the_input_that_steps() -> None:
    model = Model(structure_of("two_link_arm"), ARM, "foh")
    inputs = {"tau_1": np.zeros(N), "tau_2": np.where(T < 5.0, 0.0, 0.1)}
    comparison = compared(
        "two_link_arm", measured(model, inputs, ("angle_1", "angle_2"), kind="step"), same=model
    )
    assert comparison.step is not None
    assert comparison.step.inside.start == 1000
    assert set(errors(comparison, "same", "step_rmse")) == {"angle_1", "angle_2"}
