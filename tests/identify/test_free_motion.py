"""A free motion tells forces and inertias up to a common factor: which, when, and what is held."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.identify import linear_start, open_factor
from rigsight.records import Record
from rigsight.rigs import AXIS, ELEMENT, RIGS, RUNNING_GEAR, Rig
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

PENDULUM = """
name = "pendulum"
summary = "A pendulum swings freely."
[{of_J}.J]
unit = "kg m^2"
{default}
[parameters.c_g]
unit = "N m"
[parameters.d]
unit = "N m s/rad"
[coordinates.q]
unit = "rad"
[energy]
kinetic = "J*d(q)^2/2"
potential = "-c_g*cos(q)"
[joints.pivot]
motion = "q"
damping = "d"
[sensors.angle]
reads = "q"
unit = "rad"
"""
T = 0.01 * np.arange(400)
STAGE = {"gain": 2.0, "m": 2.0, "d": 2.4, "k": 800.0, "x_off": 1e-4, "force_off": 0.0}


def decay(u: float | np.ndarray = 0.0, start: float = 0.02) -> Record:
    driven = Record("decay", 0.01, {"u": u * np.ones(T.size)}, {})
    return simulate(compose(AXIS), STAGE, driven, np.array([start, 0.0]))


def still(rig: Rig) -> Record:
    signals = {signal.name: np.zeros(9) for signal in rig.inputs}
    return Record("still", 0.01, {**signals, **{s.name: np.arange(9.0) for s in rig.outputs}}, {})


@pytest.mark.parametrize(
    ("rig", "names", "held"),
    [
        (AXIS, {"m", "d", "k", "force_off"}, "m"),
        (RUNNING_GEAR, {"J_z", "k_c", "k_d"}, "J_z"),
        (RIGS["drive_train"], {"J_m", "J_l", "k_s", "d_s", "d_m", "d_l", "k_l"}, "J_m"),
        # Gravity is a known acceleration: masses alone still grow together. Of the masses only the sum counts: with one of them
        # held, the other makes up for any factor.
        (RIGS["cart_pendulum"], {"m_c", "m_p", "s", "I_p", "d_c", "d_p"}, "s"),
        (RIGS["two_link_arm"], {"I_1", "I_2", "m_2", "s_1", "s_2", "d_1", "d_2"}, "I_2"),
        (rig_of_text(PENDULUM.format(of_J="parameters", default="lower = 1e-6")), {"J", "c_g", "d"}, "J"),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_forces_and_inertias_grow_together(rig: Rig, names: set[str], held: str) -> None:
    constants = {p.name: 0.3 if p.default is None else p.default for p in rig.constants}
    found = open_factor(rig, [still(rig)], constants, {})
    assert found is not None
    assert set(found.names) == names
    assert (found.held, found.is_given) == (held, False)
    assert f"{held} = 1 " in found.sentence


@pytest.mark.parametrize(
    "rig",
    [ELEMENT, rig_of_text(PENDULUM.format(of_J="constants", default="default = 1.0"))],
    ids=["a prescribed motion", "a known inertia"],
)
def test_what_is_known_tells_the_factor(rig: Rig) -> None:
    assert open_factor(rig, [still(rig)], {"J": 1.0}, {}) is None


def test_an_input_that_moves_tells_the_factor() -> None:
    assert open_factor(AXIS, [decay(), decay(np.sin(T))], {"gain": 2.0}, {}) is None


def test_constant_inputs_tell_it_only_if_they_differ() -> None:
    # One level shifts the rest like an offset of the sensor; two shift it by a known force.
    assert open_factor(AXIS, [decay(0.5), decay(0.5)], {"gain": 2.0}, {}) is not None
    assert open_factor(AXIS, [decay(0.5), decay(1.0)], {"gain": 2.0}, {}) is None


def test_a_given_number_is_held_at_its_value() -> None:
    found = open_factor(AXIS, [decay()], {"gain": 2.0}, {"k": 800.0})
    assert found is not None
    assert (found.held, found.value, found.is_given) == ("k", 800.0, True)


def test_a_start_needs_no_input() -> None:
    records = [decay(0.5, 0.02), decay(0.5, 0.008)]
    found = linear_start(AXIS, records, {"gain": 2.0}, {"m": 1.0})
    assert found["k"] == pytest.approx(STAGE["k"] / STAGE["m"], rel=0.01)
    assert found["d"] == pytest.approx(STAGE["d"] / STAGE["m"], rel=0.05)
