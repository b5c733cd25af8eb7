"""Linear parameters come straight from the spectra of noise-free records."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.excitation import linear_sweep
from rigsight.identify import linear_start
from rigsight.records import Record
from rigsight.records.record import Hold
from rigsight.rigs import AXIS, ELEMENT, RUNNING_GEAR, Rig
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

DT = 5e-3
T = DT * np.arange(2000)
GEAR_CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
GEAR = {"J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 1e-3, "l_0": 0.25, "c_y": 0.98, "y_off": -5e-4}
AXIS_CONSTANTS = {"gain": -2.5}
STAGE = {"m": 2.0, "d": 5.0, "k": 800.0, "x_off": 1e-4, "force_off": 0.0}
DAMPER = {"k": 4e3, "d": 120.0, "force_off": 3.0}

ENGINE = 1e-5
"""The engine's relative RMS error is at most 1e-6; a parameter collects the errors of a band, hence ten times that."""

each_hold = pytest.mark.parametrize("hold", ["zoh", "foh", "band_limited"])


def made(
    rig: Rig,
    values: Mapping[str, float],
    hold: Hold = "foh",
    initial_state: NDArray[np.float64] | None = None,
    omega: tuple[float, float] = (1.0, 60.0),
) -> Record:
    u = linear_sweep(T, 1.0, *omega)
    record = Record(name="sweep", dt=DT, signals={"u": u}, units={}, hold=hold)
    return simulate(compose(rig), values, record, initial_state)


@each_hold
def test_running_gear(hold: Hold) -> None:
    record = made(RUNNING_GEAR, {**GEAR_CONSTANTS, **GEAR}, hold)
    found = linear_start(RUNNING_GEAR, [record], GEAR_CONSTANTS, {})
    for name in ("J_z", "k_c", "k_d", "l_0", "c_y"):
        assert found[name] == pytest.approx(GEAR[name], rel=ENGINE), name
    # Offsets are the means of the whole record: what the motion at its end has not paid back is missing.
    psi, y = record["psi"], record["y"]
    w = np.gradient(psi, DT)
    unpaid = (GEAR["J_z"] * np.ptp(w) + GEAR["k_d"] * np.ptp(psi)) / (GEAR["k_c"] * T[-1])
    assert found["psi_off"] == pytest.approx(GEAR["psi_off"], abs=unpaid)
    time_constant = 2.0 * GEAR["l_0"] / (GEAR_CONSTANTS["v"] * GEAR["c_y"])
    assert found["y_off"] == pytest.approx(GEAR["y_off"], abs=time_constant * np.ptp(y) / T[-1])


@each_hold
def test_axis(hold: Hold) -> None:
    record = made(AXIS, {**AXIS_CONSTANTS, **STAGE}, hold)
    found = linear_start(AXIS, [record], AXIS_CONSTANTS, {})
    for name in ("m", "d", "k"):
        assert found[name] == pytest.approx(STAGE[name], rel=ENGINE), name
    unpaid = (STAGE["m"] * np.ptp(np.gradient(record["x"], DT)) + STAGE["d"] * np.ptp(record["x"])) / STAGE[
        "k"
    ]
    assert found["x_off"] == pytest.approx(STAGE["x_off"], abs=unpaid / T[-1])
    assert found["force_off"] == 0.0


def test_the_wrong_hold_is_noticed() -> None:
    """A zero-order hold is half a sample late; read as linear interpolation, the mass absorbs d dt/2."""
    record = made(AXIS, {**AXIS_CONSTANTS, **STAGE}, "zoh")
    misread = Record(name="misread", dt=DT, signals=record.signals, units={}, hold="foh")
    found = linear_start(AXIS, [misread], AXIS_CONSTANTS, {})
    assert found["m"] - STAGE["m"] == pytest.approx(STAGE["d"] * DT / 2.0, rel=0.5)


def test_element_from_a_force_that_no_simulation_made() -> None:
    x = 0.01 * np.sin(3.0 * T + 0.5 * T**2)
    v = 0.01 * (3.0 + T) * np.cos(3.0 * T + 0.5 * T**2)
    force = DAMPER["k"] * x + DAMPER["d"] * v + DAMPER["force_off"]
    record = Record(name="bench", dt=DT, signals={"x": x, "force": force}, units={})
    found = linear_start(ELEMENT, [record], {}, {})
    # A cubic spline's slope errs by (omega dt)^4/180 in the middle, more at the two ends; omega dt <= 0.065.
    for name, value in DAMPER.items():
        assert found[name] == pytest.approx(value, rel=1e-4), name


BENCH = """
name = "bench"
summary = "A bench moves a damper."
[inputs.x]
unit = "m"
[constants.ratio]
unit = "1"
[parameters.d]
unit = "N s/m"
[parameters.k]
unit = "N/m"
{parameter}
[coordinates.stroke]
unit = "m"
prescribed_by = "x"
[joints.dynamics]
motion = "stroke"
damping = "ratio*d"
stiffness = "{stiffness}"
{law}
[sensors.force]
reads = "force(dynamics)"
unit = "N"
"""
FORCE = '[parameters.force_off]\nunit = "N"'


@pytest.mark.parametrize(
    ("stiffness", "parameter", "law", "truth"),
    [
        ("2*k", FORCE, 'force = "force_off"', {"k": 2e3, "force_off": 3.0}),
        ("k*ratio^2", FORCE, 'force = "force_off"', {"k": 1e3, "force_off": 3.0}),
        ("k", FORCE, 'force = "force_off/4"', {"k": 4e3, "force_off": 12.0}),
        ("k", "", "", {"k": 4e3}),
        ("k", '[parameters.x_off]\nunit = "m"', 'rest = "x_off"', {"k": 4e3, "x_off": -3.0 / 4e3}),
    ],
)
def test_an_element_may_state_its_spring_and_its_force_in_any_words(
    stiffness: str, parameter: str, law: str, truth: dict[str, float]
) -> None:
    rig = rig_of_text(BENCH.format(stiffness=stiffness, parameter=parameter, law=law))
    x = 0.01 * np.sin(3.0 * T + 0.5 * T**2)
    v = 0.01 * (3.0 + T) * np.cos(3.0 * T + 0.5 * T**2)
    force = DAMPER["k"] * x + DAMPER["d"] * v + DAMPER["force_off"]
    record = Record(name="bench", dt=DT, signals={"x": x, "force": force}, units={})
    found = linear_start(rig, [record], {"ratio": 2.0}, {})
    assert found == pytest.approx({**truth, "d": 60.0}, rel=1e-4)


def test_a_record_that_starts_in_motion() -> None:
    """The transient is part of the equation and does not bias the parameters."""
    record = made(AXIS, {**AXIS_CONSTANTS, **STAGE}, initial_state=np.array([5e-3, -0.1]))
    found = linear_start(AXIS, [record], AXIS_CONSTANTS, {})
    for name in ("m", "d", "k"):
        assert found[name] == pytest.approx(STAGE[name], rel=ENGINE), name


def test_without_a_spring() -> None:
    free = {**STAGE, "k": 0.0, "x_off": 0.0}
    record = made(AXIS, {**AXIS_CONSTANTS, **free}, omega=(5.0, 60.0))
    found = linear_start(AXIS, [record], AXIS_CONSTANTS, {"k": 0.0})
    assert (found["k"], found["x_off"], found["force_off"]) == (0.0, 0.0, 0.0)
    # A mean of x is no mean of the equation here: a start within a percent is what a fit needs.
    assert found["m"] == pytest.approx(STAGE["m"], rel=1e-2)
    assert found["d"] == pytest.approx(STAGE["d"], rel=1e-2)


def test_known_values_are_kept() -> None:
    record = made(AXIS, {**AXIS_CONSTANTS, **STAGE})
    found = linear_start(AXIS, [record], AXIS_CONSTANTS, {"m": 3.3, "x_off": 0.02})
    assert (found["m"], found["x_off"]) == (3.3, 0.02)
    assert set(found) == {p.name for p in AXIS.parameters}


def test_two_records_with_different_sample_times() -> None:
    one = made(AXIS, {**AXIS_CONSTANTS, **STAGE})
    u = linear_sweep(0.4 * T, 3.0, 2.0, 40.0)
    raw = Record(name="fast", dt=0.4 * DT, signals={"u": u}, units={}, hold="zoh")
    two = simulate(compose(AXIS), {**AXIS_CONSTANTS, **STAGE}, raw)
    found = linear_start(AXIS, [one, two], AXIS_CONSTANTS, {})
    for name in ("m", "d", "k"):
        assert found[name] == pytest.approx(STAGE[name], rel=ENGINE), name


def test_a_record_without_lateral_displacement() -> None:
    full = made(RUNNING_GEAR, {**GEAR_CONSTANTS, **GEAR})
    yaw = Record(name="yaw", dt=DT, signals={n: full[n] for n in ("u", "psi")}, units={}, hold="foh")
    found = linear_start(RUNNING_GEAR, [yaw], GEAR_CONSTANTS, {})
    assert found["k_c"] == pytest.approx(GEAR["k_c"], rel=ENGINE)
    assert set(found) == {p.name for p in RUNNING_GEAR.parameters}


@pytest.mark.parametrize("level", [0.0, 3.0, 0.1])
@pytest.mark.parametrize(
    ("rig", "constants", "still", "moving"),
    [
        (AXIS, AXIS_CONSTANTS, "x", "u"),
        (RUNNING_GEAR, GEAR_CONSTANTS, "psi", "u"),
        (ELEMENT, {}, "x", "force"),
        (ELEMENT, {}, "force", "x"),
    ],
)
def test_what_does_not_move_is_named(
    rig: Rig, constants: Mapping[str, float], still: str, moving: str, level: float
) -> None:
    signals = {still: np.full(T.size, level), moving: np.sin(5.0 * T)}
    with pytest.raises(InputError, match=f"'{still}' does not move"):
        linear_start(rig, [Record(name="r", dt=DT, signals=signals, units={})], constants, {})
