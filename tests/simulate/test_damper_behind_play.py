"""A damper that is squeezed with its spring: beside a play it acts in contact alone."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.records import Record
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, parameter_vector, record_input, simulate, simulate_sets

RIG = """
name = "gear"
[inputs.u]
unit = "N"
[parameters.m]
unit = "kg"
[parameters.c]
unit = "N s/m"
[parameters.k]
unit = "N/m"
[coordinates.x]
unit = "m"
[energy]
kinetic = "m*d(x)^2/2"
[joints.teeth]
motion = "x"
stiffness = "k"
damping = "c"
damps_spring = true
[drives.motor]
signal = "u"
force = "motor"
along = "x"
[sensors.place]
reads = "x"
unit = "m"
"""
BESIDE = RIG.replace("damps_spring = true\n", "")
VALUES = {"m": 1.5, "c": 12.0, "k": 4000.0, "g": 0.01}
DT = 1e-3


def record(u: np.ndarray) -> Record:
    return Record("r", DT, {"u": u}, {"u": "N"}, hold="foh")


def test_without_play_it_is_an_ordinary_damper() -> None:
    run = record(20.0 * np.sin(40.0 * DT * np.arange(800)))
    own, ordinary = (
        simulate(compose(rig_of_text(text)), VALUES, run, accuracy=1e-9) for text in (RIG, BESIDE)
    )
    np.testing.assert_array_equal(own["place"], ordinary["place"])


def test_in_the_gap_nothing_resists_and_in_contact_spring_and_damper_do() -> None:
    structure = compose(rig_of_text(RIG), [effect_named("free_play")])
    speed, n = 0.2, 400
    out = simulate(structure, VALUES, record(np.zeros(n)), np.array([0.0, speed]), accuracy=1e-9)["place"]
    touches = round(VALUES["g"] / speed / DT)
    np.testing.assert_allclose(out[:touches], speed * DT * np.arange(touches), rtol=1e-9)
    # A contact: m x'' + c x' + k x = 0 from x = 0 with the speed, left where it is left, then the gap back at another speed.
    omega, ratio = np.sqrt(VALUES["k"] / VALUES["m"]), VALUES["c"] / (2 * np.sqrt(VALUES["k"] * VALUES["m"]))
    damped = omega * np.sqrt(1 - ratio**2)
    back = speed * np.exp(-ratio * omega * np.pi / damped)
    away = touches + int(np.ceil(np.pi / damped / DT)) + 2
    np.testing.assert_allclose(np.diff(out[away : away + 40]) / DT, -back, rtol=1e-5)


def test_derivatives_know_when_contact_begins() -> None:
    structure = compose(rig_of_text(RIG), [effect_named("free_play")])
    run = record(np.zeros(60))
    held, n = record_input(structure, run), run.n_samples
    state = np.array([[0.0], [0.5]])
    step = 0.02
    gaps = [VALUES["g"] * (1 + step * i) for i in (0, 1)]
    p = np.array([parameter_vector(structure, {**VALUES, "g": gap}) for gap in gaps]).T
    lanes = simulate_sets(structure, held, p, np.repeat(state, 2, axis=1), n, 20)[:, 0]
    fine = [
        simulate(structure, {**VALUES, "g": gap}, run, state[:, 0], accuracy=1e-11)["place"] for gap in gaps
    ]
    slope, own = ((far - near) / (gaps[1] - gaps[0]) for near, far in (fine, lanes.T))
    # A gap that is wider is left later: the motion behind the contact is another one.
    assert np.max(np.abs(slope)) > 1.0
    assert own == pytest.approx(slope, abs=0.05 * np.max(np.abs(slope)))
