"""What acts late within a rig, against the method of steps with an independent integrator."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rigsight import rigs
from rigsight.effects import Effect, effect_named, placed
from rigsight.records.record import Record
from rigsight.rigs import RIGS, read_rig_file
from rigsight.simulate import (
    compose,
    parameter_vector,
    record_input,
    simulate,
    simulate_outputs,
    simulate_sets,
    simulate_tangents,
)
from rigsight.simulate.input_hold import Hold

Floats = NDArray[np.float64]
Past = Callable[[float], Floats]
FILES = Path(rigs.__file__).parent / "files"
DT, N = 5e-3, 100
T = DT * np.arange(N)


def at(name: str) -> Effect:
    return placed(effect_named(name.split("@")[0]), name.split("@")[1])


def held(samples: Floats, hold: Hold) -> Callable[[float], float]:
    """Return an input between its samples, held at its first value before them; a jump belongs to what follows."""

    def value(t: float) -> float:
        if hold == "foh":
            return float(np.interp(t, T, samples))
        return float(samples[np.clip(int(np.floor(t / DT + 1e-9)), 0, N - 2)])

    return value


def by_steps(
    rates: Callable[[float, Floats, Past, Callable[[float], float]], list[float]],
    start: Floats,
    delays: tuple[float, ...],
    samples: Floats,
    hold: Hold,
) -> Past:
    """Return the states at a time: from corner to corner, each step shorter than every delay so that the past is known."""
    arrivals = [T, *(T + a for a in delays), *(T + a + b for a in delays for b in delays)]
    corners = np.unique(np.round(np.concatenate(arrivals), 12))
    corners = corners[corners <= T[-1] + 1e-12]
    runs: list[tuple[float, float, Callable[[float], Floats]]] = []
    u = held(samples, hold)

    def past(t: float) -> Floats:
        if t <= 0.0:
            return start
        own = next(run for begin, end, run in reversed(runs) if begin <= t + 1e-13)
        return np.asarray(own(t))

    x = start
    for begin, end in pairwise(corners):
        n_parts = int(np.ceil((end - begin) / min(delays) - 1e-9))
        edges = np.linspace(begin, end, n_parts + 1)
        for first, last in pairwise(edges):
            # Times that are a little within: which piece of the input an end belongs to is then plain.
            inside = 1e-9 * (last - first)

            def slopes(
                t: float, x: Floats, first: float = first, last: float = last, inside: float = inside
            ) -> list[float]:
                return rates(float(np.clip(t, first + inside, last - inside)), x, past, u)

            run = solve_ivp(slopes, (first, last), x, "DOP853", rtol=1e-10, atol=1e-12, dense_output=True)
            runs.append((first, last, run.sol))
            x = run.y[:, -1]
    return past


SERVO = {"m": 1.0, "l": 0.15, "k_p": 2.0, "J": 0.02, "k_v": 3.0, "d": 0.5, "angle_off": 0.0}
GOALS = {"within range": 0.15 * np.sin(9.0 * T) * np.cos(2.0 * T), "saturated": 1.5 * np.sin(6.0 * T)}


def servo_rates(delay: float, *, whole_law: bool) -> Callable[..., list[float]]:
    """Either the reading alone is late, or all that the controller commands."""

    def rates(t: float, x: Floats, past: Past, u: Callable[[float], float]) -> list[float]:
        goal = u(t - delay) if whole_law else u(t)
        duty = float(np.clip(SERVO["k_p"] * (goal - past(t - delay)[0]), -1.0, 1.0))
        torque = SERVO["k_v"] * duty - SERVO["d"] * x[1] - SERVO["m"] * 9.81 * SERVO["l"] * np.sin(x[0])
        return [x[1], torque / (SERVO["J"] + SERVO["m"] * SERVO["l"] ** 2)]

    return rates


def shown(past: Past, state: int, late: float = 0.0) -> Floats:
    return np.array([past(t - late)[state] for t in T])


def assert_same(found: Floats, expected: Floats) -> None:
    assert np.max(np.abs(found - expected)) < 1e-6 * np.ptp(expected)


@pytest.mark.parametrize(
    ("effect", "delay", "goal", "hold"),
    [
        pytest.param("sensor_delay@angle", 0.013, "within range", "foh", marks=pytest.mark.slow),
        ("sensor_delay@angle", 0.013, "saturated", "zoh"),
        pytest.param("input_delay@motor", 0.013, "within range", "zoh", marks=pytest.mark.slow),
        pytest.param("input_delay@motor", 0.013, "saturated", "foh", marks=pytest.mark.slow),
        pytest.param("input_delay@motor", 0.0017, "saturated", "zoh", marks=pytest.mark.slow),
    ],
)
def test_a_delay_within_a_loop(effect: str, delay: float, goal: str, hold: Hold) -> None:
    structure = compose(RIGS["servo"], [at(effect)])
    record = Record("run", DT, {"goal": GOALS[goal]}, {}, hold=hold)
    start = np.array([0.1, 0.0])
    of_sensor = effect.startswith("sensor")
    found = simulate(structure, {**SERVO, "T_s" if of_sensor else "T_d": delay}, record, start)["angle"]
    past = by_steps(servo_rates(delay, whole_law=not of_sensor), start, (delay,), GOALS[goal], hold)
    assert_same(found, shown(past, 0, delay if of_sensor else 0.0))


@pytest.mark.slow
def test_a_late_drive_that_reads_a_late_sensor() -> None:
    structure = compose(RIGS["servo"], [at("input_delay@motor"), at("sensor_delay@angle")])
    record = Record("run", DT, {"goal": GOALS["saturated"]}, {}, hold="foh")
    start = np.array([0.1, 0.0])
    found = simulate(structure, {**SERVO, "T_s": 0.008, "T_d": 0.0031}, record, start)["angle"]

    def rates(t: float, x: Floats, past: Past, u: Callable[[float], float]) -> list[float]:
        command = SERVO["k_p"] * (u(t - 0.0031) - past(t - 0.0031 - 0.008)[0])
        torque = SERVO["k_v"] * np.clip(command, -1.0, 1.0) - SERVO["d"] * x[1]
        torque -= SERVO["m"] * 9.81 * SERVO["l"] * np.sin(x[0])
        return [x[1], torque / (SERVO["J"] + SERVO["m"] * SERVO["l"] ** 2)]

    past = by_steps(rates, start, (0.0031, 0.008, 0.0111), GOALS["saturated"], "foh")
    assert_same(found, shown(past, 0, 0.008))


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


TRAIN = {
    "k_t": 0.05,
    "J_m": 2e-3,
    "J_l": 6e-3,
    "k_s": 1.5,
    "d_s": 2e-3,
    "d_m": 1e-3,
    "d_l": 1e-3,
    "k_l": 0.4,
}


@pytest.mark.parametrize("hold", ["foh", "zoh"])
def test_one_late_drive_of_two(hold: Hold) -> None:
    """A late input is the input later: the arm does what it does under a command that was given later, from sample to sample."""
    tau_1, tau_2 = 0.5 * np.sin(9.0 * T), 0.2 * np.sin(14.0 * T)
    late = np.r_[np.full(3, tau_1[0]), tau_1[:-3]]
    rig = RIGS["two_link_arm"]
    given = Record("run", DT, {"tau_1": tau_1, "tau_2": tau_2}, {}, hold=hold)
    later = Record("run", DT, {"tau_1": late, "tau_2": tau_2}, {}, hold=hold)
    delayed = compose(rig, [at(f"input_delay@{rig.mechanism.drives[0].name}")])
    found = simulate(delayed, {**ARM, "T_d": 3.0 * DT}, given, np.zeros(4))
    expected = simulate(compose(rig), ARM, later, np.zeros(4))
    for name in ("angle_1", "angle_2"):
        assert_same(found[name], expected[name])


def test_two_late_drives_that_arrive_between_samples() -> None:
    """Sampled five times as finely, both commands are late by whole samples; sets side by side follow, with their derivatives."""
    rig, (first, second) = RIGS["two_link_arm"], RIGS["two_link_arm"].mechanism.drives
    commands = {"tau_1": 0.5 * np.sin(9.0 * T), "tau_2": 0.2 * np.sin(14.0 * T)}
    held = {name: np.repeat(samples, 5) for name, samples in commands.items()}
    late = {
        name: np.r_[np.full(n, held[name][0]), held[name][:-n]] for name, n in (("tau_1", 8), ("tau_2", 2))
    }
    given, fine = Record("run", DT, commands, {}, hold="zoh"), Record("run", DT / 5, late, {}, hold="zoh")
    structure = compose(rig, [at(f"input_delay@{first.name}"), at(f"input_delay@{second.name}")])
    delays = {f"input_delay@{first.name}.T_d": 8 * DT / 5, f"input_delay@{second.name}.T_d": 2 * DT / 5}
    expected = simulate(compose(rig), ARM, fine, np.zeros(4))
    found = simulate(structure, {**ARM, **delays}, given, np.zeros(4))
    p, x0, inputs = (
        parameter_vector(structure, {**ARM, **delays}),
        np.zeros(4),
        record_input(structure, given),
    )
    fast = simulate_sets(structure, inputs, p[:, None], x0[:, None], N, 8)[:, :, 0]
    for i, output in enumerate(rig.outputs):
        assert_same(found[output.name], expected[output.name][::5])
        assert_same(fast[:, i], expected[output.name][::5])
    names = [structure.names.index(name) for name in delays]
    derivatives = simulate_tangents(
        structure, inputs, p, np.eye(p.size)[:, names], x0, np.zeros((4, 2)), N, 8
    )
    for i, name in enumerate(names):
        step = 1e-5 * np.eye(p.size)[name]
        ahead, behind = (
            simulate_outputs(structure, inputs, p + sign * step, x0, N, 1e-10) for sign in (1, -1)
        )
        slope = (ahead - behind) / 2e-5
        assert np.max(np.abs(derivatives[:, :, 1 + i] - slope)) < 1e-4 * np.max(np.abs(slope))


def test_a_late_input_beside_a_late_sensor_with_kinks(tmp_path: Path) -> None:
    """Dry friction bends a speed, so its late reading needs a history; the input is late all the same."""
    path = tmp_path / "train.toml"
    more = '[sensors.load_speed]\nreads = "d(phi_m)"\nunit = "rad/s"\n'
    path.write_text((FILES / "drive_train.toml").read_text("utf-8") + more, "utf-8")
    rig, values = read_rig_file(path), {**TRAIN, "T_c": 5e-3, "T_s": 0.011}
    friction, sensor = at("coulomb_friction@motor_bearing"), at("sensor_delay@load_speed")
    motor = at(f"input_delay@{rig.mechanism.drives[0].name}")
    u = np.sin(20.0 * T)
    given = Record("run", DT, {"u": u}, {}, hold="zoh")
    later = Record("run", DT, {"u": np.r_[np.full(4, u[0]), u[:-4]]}, {}, hold="zoh")
    found = simulate(compose(rig, [friction, sensor, motor]), {**values, "T_d": 4 * DT}, given, np.zeros(4))
    expected = simulate(compose(rig, [friction, sensor]), values, later, np.zeros(4))
    assert_same(found["load_speed"], expected["load_speed"])


def test_outputs_move_smoothly_with_a_delay_however_short() -> None:
    """A fit moves a delay to zero: shorter than any step it is the derivative of a delay that counts."""
    structure = compose(RIGS["servo"], [at("input_delay@motor")])
    record = Record("run", DT, {"goal": GOALS["within range"]}, {}, hold="foh")
    delays = np.array([0.0, 1e-5, 2e-5, 1e-3, 1.001e-3, 1.002e-3])
    p = np.column_stack([parameter_vector(structure, {**SERVO, "T_d": d}) for d in delays])
    start = np.tile([[0.1], [0.0]], delays.size)
    found = simulate_sets(structure, record_input(structure, record), p, start, N, 1)[:, 0]
    exact = simulate(compose(RIGS["servo"]), SERVO, record, np.array([0.1, 0.0]))["angle"]
    assert_same(found[:, 0], exact)
    for first in (0, 3):
        slope, next_slope = (
            np.diff(found[:, first : first + 3], axis=1).T / np.diff(delays[first : first + 3])[:, None]
        )
        assert np.max(np.abs(next_slope - slope)) < 1e-2 * np.max(np.abs(slope))


@pytest.mark.parametrize("sensor", ["motor_angle", "load_speed"])
def test_any_sensor_shows_late_what_it_reads(sensor: str, tmp_path: Path) -> None:
    """The speed of a mass bends where a held input jumps; nothing else is late."""
    path = tmp_path / "train.toml"
    more = '[sensors.load_speed]\nreads = "d(phi_m)"\nunit = "rad/s"\n'
    path.write_text((FILES / "drive_train.toml").read_text("utf-8") + more, "utf-8")
    rig = read_rig_file(path)
    record = Record("run", DT, {"u": np.sin(20.0 * T)}, {}, hold="zoh")
    fine = Record("run", DT / 5, {"u": np.repeat(np.sin(20.0 * T), 5)}, {}, hold="zoh")
    late = compose(rig, [at(f"sensor_delay@{sensor}")])
    found = simulate(late, {**TRAIN, "T_s": 0.4 * DT}, record, np.zeros(4))
    expected = simulate(compose(rig), TRAIN, fine, np.zeros(4))
    assert np.max(np.abs(found[sensor][1:] - expected[sensor][3::5][: N - 1])) < 1e-5 * np.ptp(
        expected[sensor]
    )
    other = "load_angle"
    assert_same(found[other], expected[other][::5][:N])
