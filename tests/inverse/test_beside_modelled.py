"""What is missing beside effects that the given simulation has already?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, effect_named
from rigsight.identify import FitResult
from rigsight.inverse import propose
from rigsight.rigs import AXIS
from rigsight.simulate import compose

from .test_proposal import AXIS_VALUES, campaign


@pytest.mark.parametrize(
    ("modelled", "value", "is_asked"),
    [
        ("coulomb_friction", {"T_c": 3.0}, True),
        ("input_delay", {"T_d": 0.01}, True),
        ("input_dead_zone", {"u_0": 0.1}, False),
    ],
)
def test_beside_a_force_at_a_joint_or_a_delay_the_motion_is_asked(
    modelled: str, value: Mapping[str, float], is_asked: bool
) -> None:
    own = campaign(AXIS, {**AXIS_VALUES, "T_c": 3.0}, [effect_named("coulomb_friction")], (10.0, 20.0))
    own = replace(own, modelled=(effect_named(modelled),))
    found = propose(
        own, {**own.constants, **own.given, **value}, candidates_on(AXIS, CATALOGUE, own.modelled)
    )
    assert (found is not None) is is_asked


def test_a_modelled_friction_has_its_number_along_the_motion() -> None:
    friction = effect_named("coulomb_friction")
    own = campaign(AXIS, {**AXIS_VALUES, "T_c": 3.0}, [friction], (10.0, 20.0))
    own = replace(own, modelled=(friction,))
    found = propose(
        own, {**own.constants, **own.given, "T_c": 0.5}, candidates_on(AXIS, CATALOGUE, own.modelled)
    )
    assert found is not None
    assert found.taken == ()
    assert found.numbers["T_c"] == pytest.approx(3.0, rel=0.02)


def test_a_modelled_spring_law_does_not_take_the_stiffness_of_a_missing_loop() -> None:
    spring, loop = effect_named("cubic_stiffness"), effect_named("iwan_hysteresis")
    values = {**AXIS_VALUES, "k_3": 2e4, "a": 0.1, "x_s": 0.02, "q": -0.4}
    own = campaign(AXIS, values, [spring, loop], (10.0, 20.0, 40.0))
    own = replace(own, modelled=(spring,))
    found = propose(
        own, {**own.constants, **own.given, "k_3": 2e4}, candidates_on(AXIS, CATALOGUE, own.modelled)
    )
    assert found is not None
    assert [taken.family for taken in found.taken][:1] == ["memory"]
    assert "k_3" not in found.numbers


def test_the_motion_is_asked_beside_a_loop_whose_exponent_is_written_into_its_equations() -> None:
    loop, values = effect_named("bouc_wen_hysteresis"), {"A": 1.0, "a": 0.4, "beta": 30.0, "gamma": 5.0}
    own = campaign(AXIS, {**AXIS_VALUES, **values, "n": 1.0}, [loop], (10.0, 20.0))
    structure = compose(AXIS, [loop], {"n": 1.0})
    fit = FitResult(structure, True, "", values, {}, (), 1.0, 1, 1, (), np.zeros((0, 0)), ())
    own = replace(own, modelled=(loop,))
    candidates = candidates_on(AXIS, CATALOGUE, own.modelled)
    found = propose(own, {**own.constants, **own.given, **fit.all_values}, candidates)
    assert found is not None
    assert found.taken == ()


def test_beside_a_known_delay_friction_is_named() -> None:
    delay, friction = effect_named("input_delay"), effect_named("coulomb_friction")
    values = {**AXIS_VALUES, "T_d": 0.02, "T_c": 1.0}
    own = replace(campaign(AXIS, values, [delay, friction], (10.0, 20.0)), modelled=(delay,))
    found = propose(
        own, {**own.constants, **own.given, "T_d": 0.02}, candidates_on(AXIS, CATALOGUE, (delay,))
    )
    assert found is not None
    assert found.alone[0].family == "dry_friction"
    assert found.alone[0].share > 0.8


def test_beside_a_delay_whose_number_is_called_as_one_of_a_friction_the_motion_is_asked() -> None:
    """Both have a T_s: it carries the name of its effect beside the delay, and does not without it."""
    modelled = effect_named("sensor_delay"), effect_named("stribeck_friction")
    structure = compose(AXIS, modelled)
    own = {"sensor_delay": {"T_s": 0.02}, "stribeck_friction": {"T_c": 1.0, "T_s": 1.5, "w_s": 0.1}}
    numbers = {
        structure.parameter_name(effect, name): value
        for effect in modelled
        for name, value in own[effect.name].items()
    }
    assert "T_s" not in numbers
    late = campaign(AXIS, {**AXIS_VALUES, **numbers}, list(modelled), (10.0, 20.0))
    late = replace(late, modelled=modelled)
    found = propose(late, {**late.constants, **late.given, **numbers}, [effect_named("cubic_stiffness")])
    assert found is not None
    assert found.numbers["T_s"] == pytest.approx(1.5, rel=0.1)
