"""Do the printed equations say everything that the structure does?"""

from __future__ import annotations

import re
from itertools import pairwise

import pytest

from rigsight.discover.equations import equations
from rigsight.effects import effect_named
from rigsight.effects.iwan_hysteresis import N_ELEMENTS
from rigsight.rigs import AXIS
from rigsight.simulate import compose


def test_sliders_are_printed_with_their_limits() -> None:
    structure = compose(AXIS, [effect_named("iwan_hysteresis")])
    text, latex = equations(structure, {"gain": 1.0, "force_off": 0.0})
    assert text[0].startswith("m x'' = ")
    assert latex[0].startswith(r"m \ddot{x} = ")
    limits = []
    for number, (plain, pretty) in enumerate(zip(text[1:], latex[1:], strict=True)):
        told = re.fullmatch(rf"z{number}' = x' within \|z{number}\| <= (\S+) x_s", plain)
        assert told is not None, plain
        limits.append(float(told[1]))
        assert pretty == (rf"\dot{{z_{{{number}}}}} = \dot{{x}},\quad |z_{{{number}}}| \le {told[1]} x_{{s}}")
    # Over 2.7 decades, each as far from the next.
    assert len(limits) == N_ELEMENTS
    ratios = [second / first for first, second in pairwise(limits)]
    assert ratios == pytest.approx([10.0 ** (2.7 / 6)] * (N_ELEMENTS - 1), rel=2e-3)
    assert limits[-1] == pytest.approx(10.0 ** (-2.7 / 12), rel=1e-3)


def test_a_state_without_limits_has_none_printed() -> None:
    text, latex = equations(compose(AXIS, [effect_named("bouc_wen_hysteresis")]), {"n": 1.0, "A": 1.0})
    assert text[1] == "z' = -beta z |x'| - gamma x' |z| + x'"
    assert not any("within" in line for line in text)
    assert not any(r"\le " in line for line in latex)


def test_a_number_takes_the_place_of_the_parameter_of_a_limit() -> None:
    structure = compose(AXIS, [effect_named("iwan_hysteresis")])
    text, latex = equations(structure, {"x_s": 0.5})
    assert text[1] == "z0' = x' within |z0| <= 0.001675"
    assert latex[1].endswith(r"|z_{0}| \le 0.001675")
