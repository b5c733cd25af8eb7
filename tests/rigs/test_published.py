"""The published sets against the tables they were copied from, and their validation."""

from __future__ import annotations

import math

import pytest

from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.identify.transfer.conicity import conicity_slope, creep_factor
from rigsight.rigs import RIGS
from rigsight.rigs.published import parse_published_set, published_sets
from rigsight.simulate import compose, parameter_vector

GOOD = """
title = "Made up"
source = "nowhere"
rig = "axis"
[constants]
[parameters]
m = 1.0
d = 0.1
k = 4.0
"""

TABLE = {
    "nominal": (0.80, 66.0, 0.66, 0.0, 0.25, 0.024, 0.0),
    "reference": (0.28, 98.8, 21.0, -1.8e-3, 0.28, 0.050, -6.0e-4),
    "identified": (0.56, 81.0, 2.0, 1.6e-3, 0.25, 0.024, 1.9e-4),
    "sweep_0_25_ampere": (0.46, 810.0, 11.6, -1.4e-3, 0.25, 0.024, 2.0e-2),
    "sweep_0_50_ampere": (0.60, 405.0, 7.8, -7.9e-4, 0.25, 0.024, 4.2e-3),
    "sweep_0_75_ampere": (0.56, 202.5, 5.3, -1.3e-4, 0.25, 0.024, 1.9e-4),
    "sweep_1_00_ampere": (0.56, 81.0, 2.0, 1.6e-3, 0.25, 0.024, 1.9e-4),
}
HYSTERESIS = {
    "hysteresis_r": (1.0, 0.48, 7362.0, -7164.0, 1.0),
    "hysteresis_b": (1.0, 0.75, 7400.0, -7400.0, 1.0),
    "hysteresis_p": (0.25, 0.75, 7700.0, -7700.0, 1.0),
}

FOUND_HERE = {"iwan_tables"}
"""Not of the thesis; tests/experiments holds its residuals against the tables."""


@pytest.mark.parametrize("name", TABLE)
def test_sets_are_those_of_the_tables(name):
    found = published_sets()[name]
    values = {**found.parameters, **found.given}
    assert (
        tuple(values[key] for key in ("J_z", "k_c", "k_d", "psi_off", "l_0", "delta_0", "y_off"))
        == TABLE[name]
    )
    assert found.constants == {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
    assert found.parameters["c_y"] == creep_factor(found.given["delta_0"], 0.1, 0.3)
    assert found.effects == {}


@pytest.mark.parametrize("name", HYSTERESIS)
def test_hysteresis_sets_are_those_of_the_table(name):
    found = published_sets()[name]
    values = found.effects["bouc_wen_hysteresis"]
    assert tuple(values[key] for key in ("A", "a", "beta", "gamma", "n")) == HYSTERESIS[name]
    assert found.parameters == published_sets()["identified"].parameters


def test_none_is_untested_and_all_can_be_simulated():
    assert set(published_sets()) == {*TABLE, *HYSTERESIS, *FOUND_HERE}
    for found in published_sets().values():
        structure = compose(RIGS[found.rig], [effect_named(effect) for effect in found.effects])
        assert parameter_vector(structure, found.values()).size == len(structure.names)
        assert found.title
        assert "table" in found.source


def test_amplitudes_of_the_linear_fits():
    amplitudes = [published_sets()[name].amplitude for name in TABLE]
    assert amplitudes == [None, None, None, 0.25, 0.5, 0.75, 1.0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("d = 0.1", "d = -0.1"), "'d' must lie in"),
        (("k = 4.0", "kk = 4.0"), "Unknown parameters: kk"),
        (("k = 4.0", ""), "Missing parameters: k"),
        (("k = 4.0", 'k = "soft"'), "must be a number"),
        (("k = 4.0", "k = "), "made_up"),
        (('title = "Made up"', 'titel = "Made up"'), "Did you mean 'title'"),
        (('source = "nowhere"', ""), "Missing: source"),
        (('"axis"', '"axle"'), "rig is 'axle'"),
        (("k = 4.0", "k = 4.0\n[effects.coulomb_frictio]\nT_c = 1.0"), "Did you mean 'coulomb_friction'"),
        (("k = 4.0", "k = 4.0\n[effects.coulomb_friction]\nT_c = -1.0"), "'T_c' must lie in"),
    ],
)
def test_broken_sets_are_explained(change, message):
    assert parse_published_set("made_up", GOOD).parameters["x_off"] == 0.0
    with pytest.raises(InputError, match="made_up") as caught:
        parse_published_set("made_up", GOOD.replace(*change))
    assert message in str(caught.value)


@pytest.mark.parametrize("delta_0", [0.0, 0.024, 0.3])
def test_the_declared_creep_factor_is_that_of_the_thesis(delta_0):
    c_y = math.cos(delta_0) ** 2 - 2.0 * 0.1 / 0.3 * math.sin(delta_0) * math.cos(delta_0)
    assert creep_factor(delta_0, 0.1, 0.3) == pytest.approx(c_y, rel=1e-12)
    slope = -math.sin(2.0 * delta_0) - 2.0 * 0.1 / 0.3 * math.cos(2.0 * delta_0)
    assert conicity_slope(delta_0, 0.1, 0.3) == pytest.approx(slope, rel=1e-12)
