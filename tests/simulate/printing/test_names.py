"""What symbols are called: letters, words below, dots above, in every language that people read."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rigsight.effects import effect_named
from rigsight.rigs import AXIS, RUNNING_GEAR, Rig
from rigsight.simulate import compose
from rigsight.simulate.printing.names import ShownName, declared_name, shown_names
from rigsight.simulate.printing.notation import latex_name, latex_text


@pytest.mark.parametrize(
    ("declared", "name", "latex"),
    [
        ("k_c", ShownName("k", ("c",)), "k_{c}"),
        ("k_tau", ShownName("k", ("tau",)), r"k_{\tau}"),
        ("psi_off", ShownName("psi", ("off",)), r"\psi_{\text{off}}"),
        ("z0", ShownName("z", ("0",)), "z_{0}"),
        ("gain", ShownName("gain"), r"\mathrm{gain}"),
        ("T_air_gap", ShownName("T", ("air gap",)), r"T_{\text{air gap}}"),
    ],
)
def test_declared_names_become_letters(declared: str, name: ShownName, latex: str) -> None:
    assert declared_name(declared) == name
    assert latex_name(name) == latex


def test_dots_stand_above_the_letter() -> None:
    assert latex_name(ShownName("x", ("spring",)).dotted().dotted()) == r"\ddot{x}_{\text{spring}}"


def test_what_latex_reads_itself_is_escaped() -> None:
    assert latex_text("50% of_x & {y}") == r"50\% of\_x \& \{y\}"


def test_effects_are_named_where_their_symbols_are_alike() -> None:
    structure = compose(AXIS, [effect_named("coulomb_friction"), effect_named("stribeck_friction")])
    names = shown_names(structure, str.upper)
    found = {names[symbol] for symbol in structure.parameter_symbols}
    assert ShownName("T", ("c", "COULOMB_FRICTION")) in found
    assert ShownName("T", ("s",)) in found, "what only one effect has needs no more words"


def test_the_displacement_bears_the_name_of_its_column() -> None:
    for rig, column in ((AXIS, "x"), (RUNNING_GEAR, "psi")):
        structure = compose(rig)
        names = shown_names(structure)
        assert [names[state] for state in structure.states[:2]] == [
            ShownName(column),
            ShownName(column, (), 1),
        ]


def test_two_names_that_would_be_shown_alike_stay_apart(mass_on_spring: Callable[..., Rig]) -> None:
    rig = mass_on_spring({"k0": "N/m", "k_0": "N/m"}, stiffness="k0 - k_0")
    assert {ShownName("k0"), ShownName("k", ("0",))} <= set(shown_names(compose(rig)).values())
