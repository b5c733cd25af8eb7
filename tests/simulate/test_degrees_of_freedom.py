"""Rigs of several coordinates, inputs and control laws against equations written out by hand and an independent integrator."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from rigsight.effects import effect_named, placed
from rigsight.errors import InputError
from rigsight.records.record import Record
from rigsight.rigs import RIGS, RUNNING_GEAR
from rigsight.simulate import compose, simulate
from rigsight.simulate.prescribed_motion import smooth_motion

DT, N = 5e-3, 300
T = DT * np.arange(N)
Floats = NDArray[np.float64]
Rates = Callable[[float, Floats, Callable[[float], Floats]], list[float]]


def outputs(
    name: str, values: Mapping[str, float], inputs: Mapping[str, Floats], *effects: str
) -> Mapping[str, Floats]:
    rig = RIGS[name]
    chosen = [placed(effect_named(e.split("@")[0]), e.split("@")[1]) for e in effects]
    record = Record("run", DT, dict(inputs), {}, hold="foh")
    simulated = simulate(
        compose(rig, chosen), values, record, np.zeros(2 * len(rig.mechanism.free)), accuracy=1e-9
    )
    return {signal.name: simulated[signal.name] for signal in rig.outputs}


def by_hand(rates: Rates, n_states: int, inputs: Mapping[str, Floats]) -> Floats:
    """Integrate from rest, from sample to sample, the inputs linear between."""
    columns = np.column_stack(list(inputs.values()))
    x, rows = np.zeros(n_states), [np.zeros(n_states)]
    for k in range(N - 1):

        def u(tau: float, k: int = k) -> Floats:
            return np.asarray(columns[k] + tau / DT * (columns[k + 1] - columns[k]))

        x = solve_ivp(rates, (0.0, DT), x, "DOP853", args=(u,), rtol=1e-11, atol=1e-13).y[:, -1]
        rows.append(x)
    return np.array(rows)


def assert_same(found: Floats, expected: Floats) -> None:
    assert np.max(np.abs(found - expected)) < 1e-7 * np.ptp(expected)


TRAIN = {"k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}


@pytest.mark.parametrize("k_3", [0.0, 300.0])
def test_two_masses_and_a_spring_that_hardens_at_the_shaft(k_3: float) -> None:
    inputs = {"u": np.sin(8.0 * T + 6.0 * T**2)}

    def rates(tau: float, x: Floats, u: Callable[[float], Floats]) -> list[float]:
        motor, load, vm, vl = x
        shaft = 2.0 * (motor - load) + 1e-3 * (vm - vl) + k_3 * (motor - load) ** 3
        return [
            vm,
            vl,
            (0.05 * u(tau)[0] - shaft - 1e-3 * vm) / 1e-4,
            (shaft - 0.5 * load - 1e-3 * vl) / 5e-4,
        ]

    expected = by_hand(rates, 4, inputs)
    effects = ("cubic_stiffness@shaft",) if k_3 else ()
    found = outputs("drive_train", {**TRAIN, "k_3": k_3}, inputs, *effects)
    assert_same(found["motor_angle"], expected[:, 0])
    assert_same(found["load_angle"], expected[:, 1])


def test_an_arm_with_two_motors() -> None:
    l_1, g, i_1, i_2, m_2, s_1, s_2, d_1, d_2 = 0.3, 9.81, 0.05, 0.02, 0.6, 0.12, 0.08, 0.05, 0.02
    inputs = {"tau_1": 0.5 * np.sin(9.0 * T), "tau_2": 0.2 * np.sin(14.0 * T)}

    def rates(tau: float, x: Floats, u: Callable[[float], Floats]) -> list[float]:
        a, b, va, vb = x
        coupling = s_2 * l_1
        mass = [
            [i_1 + m_2 * l_1**2 + i_2 + 2.0 * coupling * np.cos(b), i_2 + coupling * np.cos(b)],
            [i_2 + coupling * np.cos(b), i_2],
        ]
        first = u(tau)[0] + coupling * np.sin(b) * vb * (2.0 * va + vb) - d_1 * va
        first -= g * (s_1 + m_2 * l_1) * np.sin(a) + g * s_2 * np.sin(a + b)
        second = u(tau)[1] - coupling * np.sin(b) * va**2 - d_2 * vb - g * s_2 * np.sin(a + b)
        return [va, vb, *np.linalg.solve(mass, [first, second])]

    expected = by_hand(rates, 4, inputs)
    values = dict(zip(("l_1", "g", "I_1", "I_2", "m_2", "s_1", "s_2", "d_1", "d_2"),
                      (l_1, g, i_1, i_2, m_2, s_1, s_2, d_1, d_2), strict=True))  # fmt: skip
    found = outputs("two_link_arm", values, inputs)
    assert_same(found["angle_1"], expected[:, 0])
    assert_same(found["angle_2"], expected[:, 1])


def test_a_road_that_is_prescribed() -> None:
    inputs = {"road": 0.02 * np.sin(6.0 * T) ** 3}
    values = {"m_b": 300.0, "m_w": 40.0, "k_b": 2e4, "d_b": 1500.0, "k_t": 2e5, "d_t": 0.0}
    found = outputs("quarter_car", values, inputs)
    path = CubicHermiteSpline(T, *smooth_motion(inputs["road"], DT))

    def rates(t: float, x: Floats) -> list[float]:
        w, b, vw, vb = x
        spring = 2e4 * (b - w) + 1500.0 * (vb - vw)
        return [vw, vb, (spring - 2e5 * (w - path(t))) / 40.0, -spring / 300.0]

    run = solve_ivp(rates, (0.0, T[-1]), np.zeros(4), "DOP853", t_eval=T, rtol=1e-10, atol=1e-13, max_step=DT)
    assert_same(found["travel"], run.y[1] - run.y[0])
    assert_same(found["body"], run.y[3])


def test_a_controller_reads_its_sensor() -> None:
    inputs = {"goal": 0.8 * np.sin(5.0 * T)}
    values = {"m": 1.0, "l": 0.15, "k_p": 2.0, "J": 0.02, "k_v": 3.0, "d": 0.2, "angle_off": 0.05}

    def rates(tau: float, x: Floats, u: Callable[[float], Floats]) -> list[float]:
        duty = float(np.clip(2.0 * (u(tau)[0] - (x[0] - 0.05)), -1.0, 1.0))
        return [x[1], (3.0 * duty - 0.2 * x[1] - 9.81 * 0.15 * np.sin(x[0])) / (0.02 + 0.15**2)]

    found = outputs("servo", values, inputs)
    assert_same(found["angle"], by_hand(rates, 2, inputs)[:, 0] - 0.05)


def test_a_rig_starts_where_it_hangs() -> None:
    record = Record("rest", DT, {"goal": np.zeros(50)}, {}, hold="zoh")
    values = {"m": 1.0, "l": 0.15, "k_p": 2.0, "J": 0.02, "k_v": 3.0, "d": 0.2, "angle_off": 0.05}
    angle = simulate(compose(RIGS["servo"]), values, record)["angle"]
    assert np.ptp(angle) < 1e-9
    assert 3.0 * 2.0 * -angle[0] == pytest.approx(9.81 * 0.15 * np.sin(angle[0] + 0.05), rel=1e-6)


@pytest.mark.parametrize("effect", ["coulomb_friction@shoulder", "input_dead_zone@yaw_dynamics"])
def test_a_place_that_cannot_take_an_effect_is_refused(effect: str) -> None:
    name, place = effect.split("@")
    with pytest.raises(InputError, match=f"'{effect}'"):
        compose(RUNNING_GEAR, [placed(effect_named(name), place)])
