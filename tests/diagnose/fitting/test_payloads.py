"""Friction under several payloads: what grows with the load is named where it does, and where nothing does it is not claimed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.result import Diagnosis
from rigsight.effects import effect_named
from rigsight.records import Record
from rigsight.records.record import Role
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

LIFT = """name = "lift"
summary = "A vertical slide under position control carries a payload; the controller knows the weight."
[inputs.goal]
unit = "m"
[constants.m]
unit = "kg"
default = 1.0
[parameters.m_0]
unit = "kg"
lower = 0.1
[parameters.k_p]
unit = "N/m"
lower = 0.0
[parameters.d]
unit = "N s/m"
lower = 0.0
[coordinates.x]
unit = "m"
[energy]
kinetic = "(m_0 + m)*d(x)^2/2"
potential = "9.81*(m_0 + m)*x"
[joints.guide]
motion = "x"
damping = "d"
[drives.motor]
signal = "k_p*(goal - height) + 9.81*(m_0 + m)"
force = "motor"
along = "x"
[sensors.height]
reads = "x"
unit = "m"
"""
RIG = rig_of_text(LIFT, check_units=False)
DT, N, NOISE = 5e-3, 1600, 1e-4
TRUTH = {"m_0": 1.5, "k_p": 3000.0, "d": 40.0}
GIVEN = {"m_0": 1.6, "k_p": 3000.0, "d": 60.0}
LOADED = ("load_dependent_friction@guide", {"T_c": 2.0, "mu": 0.12})
EVEN = ("coulomb_friction@guide", {"T_c": 10.0})
TRIED = (
    "load_dependent_friction",
    "coulomb_friction",
    "stribeck_friction",
    "directional_friction",
    "presliding_friction",
)


def record(effect: str, own: Mapping[str, float], payload: float, role: Role, seed: int) -> Record:
    rng, t = np.random.default_rng(seed), DT * np.arange(N)
    tones = sum(np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.0)) for f in (0.15, 0.35, 0.7))
    asked = Record(
        f"run {seed}",
        DT,
        {"goal": 0.03 * tones * np.minimum(1.0, t)},
        {},
        role=role,
        constants={"m": payload},
    )
    structure = compose(RIG, [effect_named(effect)])
    clean = simulate(structure, {**TRUTH, **own, "m": payload}, asked, np.zeros(2))
    return clean.with_signals(height=clean["height"] + rng.normal(scale=NOISE, size=N))


def diagnosed(effect: str, own: Mapping[str, float], payloads: tuple[float, ...]) -> Diagnosis:
    records = [record(effect, own, payload, "estimation", i) for i, payload in enumerate(payloads)]
    records.append(record(effect, own, payloads[0], "validation", len(payloads)))
    campaign = Campaign("lift", RIG, {"m": payloads[0]}, GIVEN, tuple(records))
    return diagnose(campaign, [effect_named(f"{name}@guide") for name in TRIED])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "own", "payloads"),
    [
        pytest.param(*LOADED, (1.0, 4.0, 10.0), id="grows with the load"),
        pytest.param(*EVEN, (1.0, 4.0, 10.0), id="does not"),
        pytest.param(*EVEN, (4.0, 4.0), id="does not, one payload"),
    ],
)
def test_friction_that_grows_with_the_load_is_named_where_it_does(
    effect: str, own: Mapping[str, float], payloads: tuple[float, ...]
) -> None:
    """Without friction the equations take the controller for infinitely stiff; the given numbers are where fits start then."""
    found = diagnosed(effect, own, payloads)
    assert found.effects == (effect,)
    if len(set(payloads)) > 1:
        best = found.candidates[0].parameters
        for name, value in {**TRUTH, **own}.items():
            assert abs(best[name].value - value) < 4.0 * best[name].std, name
