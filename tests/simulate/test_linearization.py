"""Linearizations against differences of the equations themselves and against python-control."""

from __future__ import annotations

from pathlib import Path

import control
import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import effect_named, placed
from rigsight.rigs import ELEMENT, RIGS, read_rig_file
from rigsight.simulate import Structure, compose
from rigsight.simulate.equations.structure import TIME, input_symbols
from rigsight.simulate.linearization import Linearization, is_linear, linearize

OMEGA = np.geomspace(0.1, 300.0, 25)

TRAIN = {"k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}
ARM = {
    "l_1": 0.3, "g": 9.81, "I_1": 0.05, "I_2": 0.02, "m_2": 0.6, "s_1": 0.12, "s_2": 0.08, "d_1": 0.05, "d_2": 0.02
}  # fmt: skip
CAR = {"m_b": 300.0, "m_w": 40.0, "k_b": 2e4, "d_b": 1500.0, "k_t": 2e5, "d_t": 100.0}
SERVO = {"m": 1.0, "l": 0.15, "k_p": 2.0, "J": 0.02, "k_v": 3.0, "d": 0.2, "angle_off": 0.05}
PENDULUM = {"g": 9.81, "m_c": 1.0, "m_p": 0.2, "s": 0.05, "I_p": 0.02, "k_u": 5.0, "d_c": 2.0, "d_p": 1e-3}
PI_LOOP = """
name = "speed_loop"
summary = "A motor keeps its speed."
[inputs.goal]
unit = "rad/s"
[constants.k_i]
unit = "N m/rad"
default = 0.3
[parameters.J]
unit = "kg m^2"
log = true
[parameters.d]
unit = "N m s/rad"
[parameters.k_p]
unit = "N m s/rad"
[coordinates.phi]
unit = "rad"
[energy]
kinetic = "J*d(phi)^2/2"
[joints.bearing]
motion = "phi"
damping = "d"
[states.w]
rate = "goal - speed"
unit = "rad"
[drives.motor]
signal = "k_p*(goal - speed) + k_i*w"
force = "motor"
along = "phi"
[sensors.speed]
reads = "d(phi)"
unit = "rad/s"
"""


def by_differences(
    structure: Structure, values: dict[str, float], at: Linearization
) -> dict[str, NDArray[np.float64]]:
    """Return the derivatives of rates and outputs at the place of a linearization, by central differences."""
    symbols = [s for i in range(len(at.inputs)) for s in input_symbols(i)]
    known = [values[name] for name in structure.names]
    rates = sp.lambdify(
        [[*structure.states], symbols, [*structure.parameter_symbols], TIME],
        [*(equation.rate for equation in structure.equations), *structure.outputs],
        [{"positive_part": lambda x: max(x, 0.0)}, "numpy"],
    )
    inputs = np.zeros(len(symbols))
    inputs[0::3] = at.at_inputs
    whole = np.concatenate([at.at_state, inputs])

    def of(place: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array(rates(place[: len(structure.states)], place[len(structure.states) :], known, 0.0))

    columns = []
    for i in range(whole.size):
        step = np.zeros(whole.size)
        step[i] = 1e-5
        columns.append((of(whole + step) - of(whole - step)) / 2e-5)
    slopes, n = np.column_stack(columns), len(structure.states)
    return {"A": slopes[:n, :n], "C": slopes[n:, :n], "B": slopes[:n, n:], "D": slopes[n:, n:]}


def in_order(roots: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return complex numbers by what rounding does not touch: conjugates differ by the sign of their imaginary part alone."""
    return np.array(sorted(np.asarray(roots), key=lambda z: (round(abs(z), 6), round(z.imag, 6))))


@pytest.mark.parametrize(
    ("name", "values", "inputs"),
    [
        ("drive_train", TRAIN, {"u": 0.3}),
        ("two_link_arm", ARM, {"tau_1": 0.3, "tau_2": 0.1}),
        ("quarter_car", CAR, {"road": 0.01}),
        ("servo", SERVO, {"goal": 0.2}),
        ("cart_pendulum", PENDULUM, {}),
    ],
)
def test_matrices_and_responses_are_those_of_the_equations(
    name: str, values: dict[str, float], inputs: dict[str, float]
) -> None:
    structure = compose(RIGS[name])
    found = linearize(structure, values, inputs)
    assert found.rests
    check_matrices_and_responses(structure, values, found)


@pytest.mark.parametrize("name", RIGS)
def test_every_rig_is_linearized_as_its_equations_say(name: str) -> None:
    """With numbers that mean nothing, so that a new rig needs none of its own here."""
    structure, rng = compose(RIGS[name]), np.random.default_rng(4)
    values = {parameter: float(rng.uniform(0.3, 0.9)) for parameter in structure.names}
    check_matrices_and_responses(structure, values, linearize(structure, values))


def check_matrices_and_responses(
    structure: Structure, values: dict[str, float], found: Linearization
) -> None:
    expected = by_differences(structure, values, found)
    size = np.max(np.abs(expected["A"]), initial=0.0)
    np.testing.assert_allclose(found.state_matrix, expected["A"], atol=1e-7 * size)
    np.testing.assert_allclose(found.output_matrix, expected["C"], atol=1e-7)
    s = 1j * OMEGA[:, None, None]
    columns = range(len(found.inputs))
    B = sum(s**order * expected["B"][:, [3 * i + order for i in columns]] for order in range(3))
    D = sum(s**order * expected["D"][:, [3 * i + order for i in columns]] for order in range(3))
    direct = expected["C"] @ np.linalg.solve(s * np.eye(len(found.states)) - expected["A"], B) + D
    np.testing.assert_allclose(
        found.frequency_response(OMEGA), direct, rtol=1e-5, atol=1e-7 * np.max(np.abs(direct))
    )


@pytest.mark.parametrize(
    ("name", "values"), [("drive_train", TRAIN), ("two_link_arm", ARM), ("quarter_car", CAR)]
)
def test_transfer_functions_poles_and_zeros_are_those_of_python_control(
    name: str, values: dict[str, float]
) -> None:
    found = linearize(compose(RIGS[name]), values)
    for j, source in enumerate(found.inputs):
        for i, response in enumerate(found.outputs):
            system = control.ss(
                found.state_matrix,
                found.input_matrix[:, [j]],
                found.output_matrix[[i]],
                found.feedthrough[0][[i]][:, [j]],
            )
            ours = found.transfer_function(source, response)
            assert np.all(found.feedthrough[1:, i, j] == 0.0)
            np.testing.assert_allclose(
                np.polyval(ours.numerator, 1j * OMEGA) / np.polyval(ours.denominator, 1j * OMEGA),
                system(1j * OMEGA),
                rtol=1e-7,
            )
            np.testing.assert_allclose(in_order(ours.poles), in_order(system.poles()), rtol=1e-7)
            # A double zero at the origin is known to the root of the rounding.
            np.testing.assert_allclose(in_order(ours.zeros), in_order(system.zeros()), rtol=1e-6, atol=1e-5)
    natural, damping, _ = control.damp(
        control.ss(found.state_matrix, found.input_matrix, found.output_matrix, 0.0 * found.feedthrough[0]),
        doprint=False,
    )
    size = np.abs(found.poles)
    np.testing.assert_allclose(np.sort(size), np.sort(natural))
    np.testing.assert_allclose(np.sort(-found.poles.real / size), np.sort(damping), atol=1e-12)


def test_the_loop_of_a_controller_with_a_state_is_closed(tmp_path: Path) -> None:
    (tmp_path / "loop.toml").write_text(PI_LOOP, "utf-8")
    found = linearize(
        compose(read_rig_file(tmp_path / "loop.toml")), {"k_i": 0.3, "J": 0.01, "d": 0.02, "k_p": 0.1}
    )
    ours = found.transfer_function("goal", "speed")
    # (k_p s + k_i) / (J s^2 + (d + k_p) s + k_i); the angle, which nothing holds, cancels.
    np.testing.assert_allclose(ours.numerator, [10.0, 30.0])
    np.testing.assert_allclose(ours.denominator, [1.0, 12.0, 30.0])
    assert found.stability == "drifts"


def test_a_force_that_follows_a_prescribed_rate_has_more_zeros_than_poles() -> None:
    found = linearize(compose(ELEMENT), {"d": 3.0, "k": 40.0, "force_off": 0.2})
    ours = found.transfer_function("x", "force")
    np.testing.assert_allclose(ours.numerator, [3.0, 40.0])
    np.testing.assert_allclose(ours.denominator, [1.0])
    np.testing.assert_allclose(found.frequency_response(OMEGA)[:, 0, 0], 40.0 + 3.0j * OMEGA)


def test_what_nothing_holds_drifts_and_does_not_rest_under_a_force() -> None:
    structure = compose(RIGS["drive_train"])
    assert linearize(structure, {**TRAIN, "k_l": 0.0}).rests
    pushed = linearize(structure, {**TRAIN, "k_l": 0.0}, {"u": 0.1})
    assert not pushed.rests
    assert pushed.stability == "drifts"
    assert pushed.poles[0] == 0.0


def test_a_rig_without_a_damper_is_undamped_and_does_not_drift() -> None:
    axis = {"gain": 1.0, "m": 1.0, "d": 0.0, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
    found = linearize(compose(RIGS["axis"]), axis)
    assert found.stability == "undamped"
    np.testing.assert_allclose(np.sort(found.poles.imag), [-10.0, 10.0])
    assert linearize(compose(RIGS["axis"]), {**axis, "d": 1.0}).stability == "stable"


def test_a_pendulum_that_stands_falls() -> None:
    structure = compose(RIGS["cart_pendulum"])
    standing = linearize(structure, PENDULUM, state=np.array([0.0, np.pi, 0.0, 0.0]))
    assert standing.rests
    assert standing.stability == "unstable"
    assert linearize(structure, PENDULUM).stability == "drifts"


def test_dry_friction_is_left_out_and_the_rest_stays() -> None:
    rig = RIGS["drive_train"]
    rough = compose(rig, [placed(effect_named("coulomb_friction"), "load_bearing")])
    with_friction = linearize(rough, {**TRAIN, "T_c": 0.01}, {"u": 0.3})
    np.testing.assert_array_equal(
        with_friction.state_matrix, linearize(compose(rig), TRAIN, {"u": 0.3}).state_matrix
    )


@pytest.mark.parametrize(("effect", "delay"), [("input_delay", "T_d"), ("sensor_delay", "T_s")])
@pytest.mark.parametrize("late", [0.0, 0.02, 0.2])
def test_a_delay_inside_a_loop_acts_inside_the_loop(
    effect: str, delay: str, late: float, tmp_path: Path
) -> None:
    (tmp_path / "loop.toml").write_text(PI_LOOP, "utf-8")
    structure = compose(read_rig_file(tmp_path / "loop.toml"), [effect_named(effect)])
    J, d, k_i, k_p = 0.01, 0.02, 0.3, 0.1
    values = {"J": J, "d": d, "k_i": k_i, "k_p": k_p, delay: late}
    found = linearize(structure, {name: values[name] for name in structure.names})
    s, law = 1j * OMEGA, k_p + k_i / (1j * OMEGA)
    turned = np.exp(-s * late)
    closed = law * turned / (J * s + d + law * turned)
    np.testing.assert_allclose(found.frequency_response(OMEGA)[:, 0, 0], closed, rtol=1e-9)
    # The open loop loses more than 180 degrees before its magnitude falls below 1 (near 10.4 rad/s) for delays above 0.12 s.
    assert found.is_unstable == (late > 0.12)


def test_a_model_is_linear_if_its_equations_are(tmp_path: Path) -> None:
    axis = {"gain": 1.0, "m": 2.0, "d": 40.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
    for effect, own, expected in (
        ("input_delay", {"T_d": 0.1}, True),
        ("sensor_lag", {"T_m": 0.1}, True),
        ("cubic_stiffness", {"k_3": 1.0}, False),
        ("cubic_stiffness", {"k_3": 0.0}, True),
        ("coulomb_friction", {"T_c": 1.0}, False),
        ("input_saturation", {"u_max": 1.0}, False),
        ("periodic_disturbance", {"T_p": 1.0, "w_p": 3.0, "phi": 0.0}, False),
    ):
        structure = compose(RIGS["axis"], [effect_named(effect)])
        values = {**axis, **own}
        assert is_linear(structure, {name: values[name] for name in structure.names}) is expected, effect
    arm = compose(RIGS["two_link_arm"])
    assert not is_linear(arm, {name: ARM.get(name, 1.0) for name in arm.names})
