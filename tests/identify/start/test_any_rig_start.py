"""Start values of rigs of several motions come from the records alone, whatever their sizes are."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.effects import CATALOGUE, placed
from rigsight.errors import InputError
from rigsight.identify import linear_start
from rigsight.identify.rig_equations import equations_of
from rigsight.identify.start.any_rig_start import _Rough
from rigsight.identify.start.weak_equations import WeakEquations
from rigsight.records.record import Record
from rigsight.rigs import RIGS, Rig
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

DT = 5e-3
T = DT * np.arange(2000)
SHARE = 5e-3
"""Noise over the size of what is measured."""
TRAIN = {"J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}
CAR = {"m_w": 40.0, "k_b": 2e4, "d_b": 1500.0, "k_t": 2e5, "d_t": 100.0}
SERVO = {"J": 0.02, "k_v": 3.0, "d": 0.2, "angle_off": 0.15}
PENDULUM = """
name = "pendulum"
[constants.g]
unit = "m/s^2"
default = 9.81
[parameters.m]
unit = "kg"
lower = 1e-3
log = true
{default}
[parameters.l]
unit = "m"
lower = 1e-3
log = true
[parameters.d]
unit = "m^2/s"
lower = 0.0
[coordinates.q]
unit = "rad"
[energy]
kinetic = "m*l^2*d(q)^2/2"
potential = "-m*g*l*cos(q)"
[joints.pivot]
motion = "q"
damping = "m*d"
[sensors.angle]
reads = "q"
unit = "rad"
"""


def rig_of(name: str) -> Rig:
    return RIGS[name]


def measured(
    rig: Rig,
    values: Mapping[str, float],
    inputs: Mapping[str, NDArray[np.float64]],
    sensors: tuple[str, ...] | None = None,
    state: NDArray[np.float64] | None = None,
    constants: Mapping[str, float] | None = None,
) -> Record:
    signals = dict(inputs) or {"unread": np.zeros_like(T)}
    record = simulate(compose(rig), values, Record("run", DT, signals, {}, constants=constants or {}), state)
    rng = np.random.default_rng(4)
    kept = sensors or tuple(s.name for s in rig.outputs)
    noisy = {n: record[n] + SHARE * np.std(record[n]) * rng.standard_normal(T.size) for n in kept}
    return Record("run", DT, {**inputs, **noisy}, {}, constants=constants or {})


def chirp(amplitude: float, fastest: float = 30.0) -> NDArray[np.float64]:
    return amplitude * np.sin(1.0 * T + fastest / T[-1] * T**2 / 2.0)


def constants_of(rig: Rig) -> dict[str, float]:
    return {c.name: c.default for c in rig.constants if c.default is not None}


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_a_rate_and_a_travel_tell_all_of_a_car_whatever_its_size(factor: float) -> None:
    rig = rig_of("quarter_car")
    truth = {name: value * factor for name, value in CAR.items()}
    constants = {"m_b": 300.0 * factor}
    record = measured(rig, {**truth, **constants}, {"road": chirp(0.02)})
    found = linear_start(rig, [record], constants, {})
    for name in ("m_w", "k_b", "d_b", "k_t"):
        assert found[name] == pytest.approx(truth[name], rel=0.05), name


@pytest.mark.slow
def test_a_load_that_no_sensor_shows_is_told_by_the_resonances_of_the_motor() -> None:
    rig = rig_of("drive_train")
    record = measured(rig, TRAIN, {"u": chirp(1.0, 250.0)}, ("motor_angle",))
    found = linear_start(rig, [record], constants_of(rig), {})
    for name in ("J_m", "J_l", "k_s", "k_l"):
        assert found[name] == pytest.approx(TRAIN[name], rel=0.05), name


def test_a_controller_that_saturates_and_payloads_that_differ() -> None:
    rig = rig_of("servo")
    constants = constants_of(rig)
    records = [
        measured(rig, {**constants, **SERVO}, {"goal": chirp(1.2, 12.0)}, constants={"m": payload})
        for payload in (0.6, 1.5)
    ]
    found = linear_start(rig, records, constants, {})
    for name in ("J", "k_v", "d"):
        assert found[name] == pytest.approx(SERVO[name], rel=0.05), name
    assert found["angle_off"] == pytest.approx(SERVO["angle_off"], abs=0.02)


def test_a_decay_without_input_and_a_mass_that_it_does_not_tell() -> None:
    truth = {"m": 30.0, "l": 0.4, "d": 0.02}
    for default in ("", "default = 2.0"):
        rig = rig_of_text(PENDULUM.format(default=default))
        record = measured(rig, truth, {}, state=np.array([1.4, 0.0]))
        found = linear_start(rig, [record], constants_of(rig), {})
        assert found["l"] == pytest.approx(0.4, rel=0.01)
        assert found["d"] == pytest.approx(0.02, rel=0.05)
        # No record tells it: it stays at its default, or at what balances the terms, here about one.
        if default:
            assert found["m"] == pytest.approx(2.0, rel=0.05)
        else:
            assert 0.1 < found["m"] < 10.0


def test_a_known_value_is_kept_and_others_follow_from_it() -> None:
    rig = rig_of("drive_train")
    record = measured(rig, TRAIN, {"u": chirp(1.0)})
    known = {"d_m": 1e-3, "k_l": 0.5}
    found = linear_start(rig, [record], constants_of(rig), known)
    assert {name: found[name] for name in known} == known
    assert set(found) == {p.name for p in rig.parameters}
    assert found["J_l"] == pytest.approx(TRAIN["J_l"], rel=0.05)


def test_records_without_a_sensor_or_without_motion_are_refused() -> None:
    rig = rig_of("drive_train")
    with pytest.raises(InputError, match=r"No estimation record contains a sensor.*motor_angle, load_angle"):
        linear_start(rig, [Record("run", DT, {"u": chirp(1.0)}, {})], constants_of(rig), {})
    still = Record("run", DT, {"u": chirp(1.0), "motor_angle": np.full_like(T, 0.3)}, {})
    with pytest.raises(InputError, match="No sensor moves"):
        linear_start(rig, [still], constants_of(rig), {})


GYRO = """
name = "gyro"
[inputs.stepper]
unit = "rad"
[parameters.gain]
unit = "1"
[parameters.bias]
unit = "rad/s"
[coordinates.angle]
unit = "rad"
prescribed_by = "stepper"
[sensors.rate]
reads = "gain*d(angle) + bias"
unit = "rad/s"
"""


def test_sensors_of_a_prescribed_motion_need_no_joint() -> None:
    rig = rig_of_text(GYRO)
    truth = {"gain": 1.05, "bias": 0.02}
    record = measured(rig, truth, {"stepper": chirp(0.5)})
    found = linear_start(rig, [record], {}, {})
    assert found["gain"] == pytest.approx(1.05, rel=0.01)
    noise = SHARE * np.std(record["rate"]) / np.sqrt(T.size)
    assert found["bias"] == pytest.approx(0.02, abs=3.0 * noise)
    every = [placed(own, place) for own in CATALOGUE for place in rig.places(own.place)]
    offered = [effect for effect in every if rig.offers(effect)]
    assert {effect.at for effect in offered} == {"rate"}
    for effect in offered:
        assert compose(rig, [effect]).effects == (effect,)
    with pytest.raises(InputError, match="at least one"):
        rig_of_text(GYRO.replace('prescribed_by = "stepper"', ""))


@pytest.mark.slow
@pytest.mark.parametrize("n_samples", [20, 50, 63])
def test_a_short_record_is_cut_into_pieces_that_say_more_than_their_own_initial_states(
    n_samples: int,
) -> None:
    rig = rig_of("quarter_car")
    record = measured(rig, {**CAR, "m_b": 300.0}, {"road": chirp(0.02)}).slice(0, n_samples)
    rough = _Rough(rig, [record], {"m_b": 300.0}, [p.name for p in rig.parameters])
    _, whole = rough.lengthening({"m_b": 300.0, **{name: 1.3 * value for name, value in CAR.items()}})
    assert np.isfinite(whole.cost)
    assert rough.holds_at_any_length(whole)


def test_the_error_of_true_equations_is_of_the_size_that_noise_makes_it() -> None:
    rig = rig_of("quarter_car")
    record = measured(rig, {**CAR, "m_b": 300.0}, {"road": chirp(0.02)})
    names = [p.name for p in rig.parameters]
    weak = WeakEquations(equations_of(rig), [record], {"m_b": 300.0}, names)
    assert weak.n_records == 1
    truth = np.array([CAR[name] for name in names])
    least = np.mean(weak.errors(truth) ** 2)
    assert least < 10.0
    for index in range(3):
        wrong = truth.copy()
        wrong[index] *= 1.5
        assert np.mean(weak.errors(wrong) ** 2) > 3.0 * least
