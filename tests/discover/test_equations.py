"""Do the printed equations say everything that the structure does?"""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp

from rigsight.discover.assembly import equations, held_numbers
from rigsight.effects import effect_named
from rigsight.effects.iwan_hysteresis import N_ELEMENTS
from rigsight.identify import FitResult
from rigsight.rigs import AXIS, RIGS, Rig
from rigsight.simulate import compose
from rigsight.simulate.printing.shown import flat_equations


def test_sliders_are_printed_with_their_limits() -> None:
    structure = compose(AXIS, [effect_named("iwan_hysteresis")])
    text, latex = equations(structure, {"gain": 1.0, "force_off": 0.0})
    assert text[0].startswith("m x'' = ")
    assert latex[0].startswith(r"m \ddot{x} = ")
    limits = []
    for number, (plain, pretty) in enumerate(zip(text[1:], latex[1:], strict=True)):
        reported = re.fullmatch(rf"z_{number}' = x' within \|z_{number}\| <= (\S+) x_s", plain)
        assert reported is not None, plain
        limits.append(float(reported[1]))
        limit = rf"\left|z_{{{number}}}\right| \leq {reported[1]} x_{{s}}"
        assert pretty == rf"\dot{{z}}_{{{number}}} = \dot{{x}},\quad {limit}"
    # Over 2.7 decades, each as far from the next.
    assert len(limits) == N_ELEMENTS
    ratios = [second / first for first, second in pairwise(limits)]
    assert ratios == pytest.approx([10.0 ** (2.7 / 6)] * (N_ELEMENTS - 1), rel=2e-3)
    assert limits[-1] == pytest.approx(10.0 ** (-2.7 / 12), rel=1e-3)


def test_a_state_without_limits_has_none_printed() -> None:
    text, latex = equations(compose(AXIS, [effect_named("bouc_wen_hysteresis")]), {"n": 1.0, "A": 1.0})
    assert text[1] == "z' = x' - beta z |x'| - gamma x' |z|"
    assert not any("within" in line for line in text)
    assert not any(r"\leq" in line for line in latex)


def test_a_number_takes_the_place_of_the_parameter_of_a_limit() -> None:
    structure = compose(AXIS, [effect_named("iwan_hysteresis")])
    text, latex = equations(structure, {"x_s": 0.5})
    assert text[1] == "z_0' = x' within |z_0| <= 0.001675"
    assert latex[1].endswith(r"\left|z_{0}\right| \leq 0.001675")


def test_a_number_is_written_with_its_digits() -> None:
    text, latex = equations(compose(RIGS["drive_train"], []), {"J_m": 0.0314159265358979 / 3.7, "d_m": 0.0})
    assert text[0] == "0.008491 phi_m'' = k_t u - d_s (phi_m' - phi_l') - k_s (phi_m - phi_l)"
    assert latex[0].startswith(r"0.008491 \ddot{\phi}_{m} = k_{t} u")


def test_of_held_parameters_only_those_that_shorten_the_equations_are_written_as_numbers() -> None:
    structure = compose(RIGS["drive_train"], [effect_named("power_law_stiffness@shaft")])
    values = dict.fromkeys(structure.names, 0.5) | {"x_r": 0.1234567890123, "k_l": 0.0, "n": 1.0, "k_t": 1.0}
    free = ("k_p", "n")
    fit = FitResult(structure, True, "", values, {}, (), 1.0, 1, 1, free, np.eye(2), (), ())
    assert held_numbers(fit) == {"k_l": 0.0}


def test_the_drive_stands_first_and_what_vanishes_does_not_stand() -> None:
    effects = [effect_named(name) for name in ("input_delay", "cubic_stiffness")]
    text, latex = equations(compose(AXIS, effects), {"gain": 1.0, "force_off": 0.0})
    assert text == ("m x'' = u(t - T_d) - d x' - k (x - x_off) - k_3 (x - x_off)^3",)
    assert latex[0].startswith(r"m \ddot{x} = u\left(t - T_{d}\right) - d \dot{x} - ")


def test_parameters_of_one_name_are_told_apart_in_both() -> None:
    effects = [effect_named(name) for name in ("bouc_wen_hysteresis", "iwan_hysteresis")]
    text, latex = equations(compose(AXIS, effects), {})
    assert "bouc_wen_hysteresis.a" in text[0]
    assert r"a_{\text{bouc wen hysteresis}}" in latex[0]


@pytest.mark.parametrize(
    "rig", [rig for rig in RIGS.values() if rig.has_one_motion], ids=lambda rig: rig.name
)
@pytest.mark.parametrize("names", [("backlash", "bouc_wen_hysteresis"), ("input_dead_zone", "actuator_lag")])
def test_equations_without_definitions_are_those_that_are_simulated(rig: Rig, names: tuple[str, ...]) -> None:
    effects = [effect_named(name) for name in names]
    if not all(rig.offers(effect) for effect in effects):
        pytest.skip("not on this rig")
    structure = compose(rig, effects)
    rates = [sp.Add(*equation.terms) for equation in flat_equations(structure, {}).equations]
    simulated = [equation.rate for equation in structure.equations[2 if rig.is_driven else 0 :]]
    if rig.is_driven:
        inertia = structure.tree.motion.mass[0, 0]
        simulated.insert(0, structure.equations[1].rate * inertia)
    else:
        simulated += structure.outputs
    assert [sp.simplify(a - b) for a, b in zip(rates, simulated, strict=True)] == [0] * len(rates)
