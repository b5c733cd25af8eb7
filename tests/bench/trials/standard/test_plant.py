"""The drawn rig moves as its equations say, and as the simulation says that shares no integrator with it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

from rigsight.effects import effect_named
from rigsight.errors import SimulationError
from rigsight.records import Record
from rigsight.rigs import AXIS, RUNNING_GEAR
from rigsight.simulate import compose, simulate
from rigsight.units import characteristic_value
from rigsight_bench.trials.standard.outside import OUTSIDE
from rigsight_bench.trials.standard.plant import Plant
from rigsight_bench.trials.strength import draw_shape, scaled
from rigsight_bench.trials.waveforms import Step, Sweep, samples

DT = 5e-3
GEAR = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0,
    "psi_off": 5e-4, "l_0": 0.25, "c_y": 0.95, "y_off": 2e-4,
}  # fmt: skip
OMEGA = (81.0 / 0.56) ** 0.5
SCALES = {"x": 0.03, "input": 1.0, "drive": 0.81, "force": 2.43, "time": 1.0 / OMEGA, "length": 0.01}
SWEEP = Sweep(0.5, 1.0, 60.0, 8.0)
N_SAMPLES = 1601
PER_SAMPLE = 20
"""Input samples per sample of the record, for the simulation that the plant is held against."""


def quiet(_: float) -> float:
    return 0.0


def gear_with(*names: str) -> tuple[Plant, dict[str, float], np.ndarray]:
    effects = [effect_named(name) for name in names]
    structure = compose(RUNNING_GEAR, effects)
    values = dict(GEAR)
    for effect in effects:
        for p in effect.parameters:
            start = p.starts[0] * characteristic_value(p.dimension, SCALES) if p.starts else p.default
            values[structure.parameter_name(effect, p.name)] = start
    sizes = np.array([characteristic_value(dimension, SCALES) for dimension in structure.state_dimensions])
    state = np.zeros(len(structure.states))
    state[0] = GEAR["psi_off"]
    return Plant(structure, values, sizes), values, state


@pytest.mark.parametrize(
    "names",
    [
        ("cubic_stiffness",),
        ("coulomb_friction",),
        ("stribeck_friction", "quadratic_damping"),
        ("bouc_wen_hysteresis",),
        ("iwan_hysteresis",),
        ("backlash",),
        ("end_stop", "input_dead_zone"),
        ("input_delay",),
        ("actuator_lag", "creep_saturation"),
        ("sensor_delay",),
    ],
    ids="+".join,
)
def test_the_plant_agrees_with_the_simulation_of_a_finely_sampled_input(names: tuple[str, ...]) -> None:
    plant, values, state = gear_with(*names)
    moved = plant.respond(SWEEP, quiet, state, 0.0, DT, N_SAMPLES)
    t = DT / PER_SAMPLE * np.arange(PER_SAMPLE * (N_SAMPLES - 1) + 1)
    fine = Record("fine", DT / PER_SAMPLE, {"u": samples(SWEEP, t)}, {}, hold="foh")
    simulated = simulate(plant.structure, values, fine, state, accuracy=1e-8)
    for i, output in enumerate(("psi", "y")):
        expected = simulated[output][::PER_SAMPLE]
        assert np.sqrt(np.mean((moved[:, i] - expected) ** 2)) < 1e-5 * np.std(expected)


def test_a_reading_that_is_recorded_early_shows_the_motion_ahead() -> None:
    plant, values, state = gear_with("time_shift")
    sizes = np.array([characteristic_value(d, SCALES) for d in plant.structure.state_dimensions])
    plant = Plant(plant.structure, values | {"T_x": -3.0 * DT}, sizes)
    on_time, _, _ = gear_with()
    shifted = plant.respond(SWEEP, quiet, state, 0.0, DT, N_SAMPLES)
    exact = on_time.respond(SWEEP, quiet, state, 0.0, DT, N_SAMPLES + 3)
    np.testing.assert_allclose(shifted[:, 0], exact[3:, 0], atol=1e-9)
    np.testing.assert_allclose(shifted[:, 1], exact[:-3, 1], atol=1e-9)


def test_a_linear_axis_answers_a_step_as_its_exact_solution() -> None:
    mass, damping, stiffness, force = 2.0, 3.0, 250.0, 40.0
    values = {"gain": force, "m": mass, "d": damping, "k": stiffness, "x_off": 0.01, "force_off": 0.0}
    plant = Plant(compose(AXIS), values, np.array([0.1, 1.0]))
    moved = plant.respond(Step(0.7, 0.5), quiet, np.array([0.01, 0.0]), -1.0, DT, 801)[:, 0]
    t = DT * np.arange(801)
    decay = damping / (2.0 * mass)
    omega = np.sqrt(stiffness / mass - decay**2)
    after = np.maximum(t - 0.5, 0.0)
    swing = np.exp(-decay * after) * (np.cos(omega * after) + decay / omega * np.sin(omega * after))
    assert np.allclose(moved, 0.01 + 0.7 * force / stiffness * (1.0 - swing), rtol=0.0, atol=1e-8)


def test_a_disturbance_acts_like_a_drive_of_its_size() -> None:
    values = {"gain": 5.0, "m": 2.0, "d": 3.0, "k": 250.0, "x_off": 0.0, "force_off": 0.0}
    plant = Plant(compose(AXIS), values, np.array([0.1, 1.0]))
    moved = plant.respond(Step(0.0, 1.0), lambda t: 3.0 * np.sin(7.0 * t), np.zeros(2), 0.0, DT, 1001)[:, 0]
    t = DT / 50 * np.arange(50_001)
    system = StateSpace([[0.0, 1.0], [-125.0, -1.5]], [[0.0], [0.5]], [[1.0, 0.0]], [[0.0]])
    expected = lsim(system, 3.0 * np.sin(7.0 * t), t)[1][::50]
    assert np.max(np.abs(moved - expected)) < 1e-6 * np.max(np.abs(expected))


def test_friction_holds_the_mass_until_the_drive_exceeds_it() -> None:
    structure = compose(AXIS, [effect_named("coulomb_friction")])
    values = {"gain": 1.0, "m": 2.0, "d": 3.0, "k": 250.0, "x_off": 0.0, "force_off": 0.0, "T_c": 1.0}
    plant = Plant(structure, values, np.array([0.1, 1.0]))
    held = plant.respond(Step(0.999, 0.1), quiet, np.zeros(2), 0.0, DT, 400)
    freed = plant.respond(Step(5.0, 0.1), quiet, np.zeros(2), 0.0, DT, 2000)
    assert np.all(held == 0.0)
    # It comes to rest within the band that friction holds around the equilibrium of 5/250, and stays there to the last digit.
    assert abs(freed[-1, 0] - 5.0 / 250.0) <= 1.0 / 250.0
    assert freed[-1, 0] == freed[-200, 0] != 0.0


@pytest.mark.slow
def test_every_effect_from_outside_moves_the_record_and_vanishes_with_its_strength() -> None:
    state = np.array([GEAR["psi_off"], 0.0, 0.0])
    sizes = np.array([SCALES["x"], SCALES["x"] * OMEGA, SCALES["length"]])
    linear = Plant(compose(RUNNING_GEAR), GEAR, sizes).respond(SWEEP, quiet, state, -0.5, DT, 801)
    for effect in OUTSIDE:
        structure = compose(RUNNING_GEAR, [effect])
        own = draw_shape(effect, SCALES, np.random.default_rng(1))
        moved = {}
        for strength in (1e-9, 1.0):
            values = {**GEAR, **scaled(effect, own, strength, SCALES)}
            all_sizes = [characteristic_value(dimension, SCALES) for dimension in structure.state_dimensions]
            begin = np.concatenate([state, np.zeros(len(structure.states) - 3)])
            plant = Plant(structure, values, np.array(all_sizes))
            moved[strength] = plant.respond(SWEEP, quiet, begin, -0.5, DT, 801)
        assert np.allclose(moved[1e-9], linear, rtol=0.0, atol=1e-6 * np.std(linear[:, 0])), effect.name
        assert np.std(moved[1.0][:, 0] - linear[:, 0]) > 1e-3 * np.std(linear[:, 0]), effect.name


def test_a_motion_without_end_is_told() -> None:
    structure = compose(AXIS, [effect_named("cubic_stiffness")])
    values = {"gain": 1.0, "m": 1.0, "d": 0.1, "k": 1.0, "x_off": 0.0, "force_off": 0.0, "k_3": -50.0}
    with pytest.raises(SimulationError):
        Plant(structure, values, np.ones(2)).respond(Step(5.0, 0.1), quiet, np.zeros(2), 0.0, DT, 4000)
