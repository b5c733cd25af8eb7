"""Are the numbers of the equations found along the measured motion, whatever is free?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, effect_named
from rigsight.inverse import EquationFit, propose, record_motions
from rigsight.rigs import RIGS, Rig
from rigsight.rigs.reading.rig_file import rig_of_text

from .test_proposal import AXIS_VALUES, TRAIN, campaign

CART = """
name = "cart"
summary = "A cart whose numbers are all known."
[inputs.f]
unit = "N"
[constants.m]
unit = "kg"
[coordinates.x]
unit = "m"
[energy]
kinetic = "m*d(x)^2/2"
[joints.rail]
motion = "x"
[drives.motor]
signal = "f"
force = "motor"
along = "x"
[sensors.x]
reads = "x"
unit = "m"
"""


@pytest.fixture(scope="module")
def train() -> Rig:
    return RIGS["drive_train"]


def test_numbers_are_found_from_others(train: Rig) -> None:
    own = campaign(train, TRAIN, [], (0.8, 1.5))
    fit = EquationFit(train, record_motions(train, own.records, TRAIN), (), ("J_m", "J_l", "k_s"), TRAIN)
    found, _ = fit.settled({**TRAIN, "J_m": 2e-4, "J_l": 4e-4, "k_s": 1.0})
    assert found["J_l"] == pytest.approx(TRAIN["J_l"], rel=0.02)
    assert found["k_s"] == pytest.approx(TRAIN["k_s"], rel=0.02)


def test_where_nothing_is_free_the_numbers_stay(train: Rig) -> None:
    own = campaign(train, TRAIN, [], (0.8,))
    motions = record_motions(train, own.records, TRAIN)
    fit = EquationFit(train, motions, (), (), TRAIN)
    assert fit.independent(TRAIN) == ()
    assert fit.settled(TRAIN)[0] == TRAIN
    assert fit.slopes(motions[0], TRAIN).shape == (0, 2, own.records[0].n_samples)


def test_of_two_numbers_that_do_the_same_the_first_is_free() -> None:
    rig = RIGS["axis"]
    own = campaign(rig, AXIS_VALUES, [], (10.0,))
    motions = record_motions(rig, own.records, AXIS_VALUES)
    fit = EquationFit(rig, motions, (), ("force_off", "k", "x_off"), AXIS_VALUES)
    assert fit.independent(AXIS_VALUES) == ("force_off", "k")


def test_a_rig_without_a_free_number_is_asked_too() -> None:
    rig = rig_of_text(CART, "cart.toml")
    friction = effect_named("coulomb_friction")
    own = campaign(rig, {"m": 2.0, "T_c": 0.5}, [friction], (3.0,))
    found = propose(own, {"m": 2.0}, candidates_on(rig, CATALOGUE))
    assert found is not None
    assert found.alone[0].family == friction.family


def test_a_change_that_widens_the_band_is_compared_in_the_band_of_the_measured_motion() -> None:
    rig = RIGS["axis"]
    (record,) = campaign(rig, AXIS_VALUES, [], (10.0,)).records
    x = record["x"]
    beat = 0.02 * np.std(x) * np.sin(0.5 * np.pi * np.arange(len(x)))
    motions = [record_motions(rig, [own], AXIS_VALUES) for own in (record, record.with_signals(x=x + beat))]
    before, after = (EquationFit(rig, own, (), ("k", "d"), AXIS_VALUES) for own in motions)
    assert motions[1][0].band != motions[0][0].band
    wide = float(np.sqrt(np.mean((after.rows(AXIS_VALUES)[0] - np.mean(after.rows(AXIS_VALUES)[0])) ** 2)))
    assert before.unexplained(after, AXIS_VALUES, np.ones(1))[0] < 0.1 * wide


def test_beside_a_delay_of_one_of_two_drives_on_one_input_nothing_is_asked() -> None:
    second = '[drives.brake]\nsignal = "f"\nforce = "-brake/10"\nalong = "x"\n[sensors.x]'
    rig = rig_of_text(CART.replace("[sensors.x]", second), "cart.toml")
    friction, delay = effect_named("coulomb_friction"), effect_named("input_delay@motor")
    own = campaign(rig, {"m": 2.0, "T_c": 0.5}, [friction], (3.0,))
    late = replace(own, modelled=(delay,))
    assert propose(late, {"m": 2.0, "T_d": 0.01}, candidates_on(rig, CATALOGUE, late.modelled)) is None
