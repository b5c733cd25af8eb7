"""Is an effect that is written as a file the same when it is read, and can it be used at once?"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from rigsight.discover.own_laws import own_laws
from rigsight.discover.shape import Shape
from rigsight.discover.terms import known_terms
from rigsight.effects import Effect
from rigsight.rigs import AXIS
from rigsight.simulate import compose
from rigsight.simulate.model import Model
from rigsight.workflow.own.effect_checks import failed_checks
from rigsight.workflow.own.own_effects import effect_file, own_effects

(JOINT,) = AXIS.mechanism.joints


def shape(argument: str, sigmoids: tuple[int, ...], forces: tuple[float, ...]) -> tuple[str, Effect]:
    found = Shape(JOINT, argument, 0.0123456, (), sigmoids, forces, 1.0)
    return found.equation, found.effect


def powers(**values: float) -> tuple[str, Effect]:
    """Return the law of an equation on an axis, given by its coefficients."""
    known = {effect.parameters[0].name: effect for effect in known_terms().values()}
    structure = compose(AXIS, [known[name] for name in values])
    model = Model.of(structure, {**dict.fromkeys(structure.names, 1.0), **values}, "foh")
    (law,) = own_laws(model, (), {"x": 0.03, "force": 2.0, "time": 0.05})
    return str(law.torque), law


LAWS = {
    "spring that saturates": shape("displacement", (5, 7, 11), (0.051, 0.168, -0.028)),
    "friction in one direction": shape("velocity", (4, 20), (0.2, -0.1)),
    "motor constant by position": powers(b_10=-8.0, b_20=32.0),
    "damping by position": powers(c_11=20.0, c_03=2.0),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_file_declares_what_was_written(law: tuple[str, Effect], tmp_path: Path) -> None:
    path = tmp_path / "law.py"
    path.write_text(effect_file("A law.", dict([law])), encoding="utf-8")
    (read,) = own_effects([path], check=False)
    assert read == law[1]


def test_a_file_may_declare_several(tmp_path: Path) -> None:
    first, second = LAWS["spring that saturates"], LAWS["motor constant by position"]
    path = tmp_path / "laws.py"
    path.write_text(effect_file("Two laws.", dict([first, second])), encoding="utf-8")
    assert own_effects([path], check=False) == (first[1], second[1])


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_what_is_written_passes_the_checks_of_own_effects(law: tuple[str, Effect]) -> None:
    assert failed_checks(law[1]) == ()


def test_parts_of_a_sum_that_no_record_tells_apart_fail_them() -> None:
    """A small part counts in units of the largest; two parts that do the same are still not determined."""
    _, law = shape("displacement", (7, 7), (0.2, 0.01))
    assert any("do not determine" in failed for failed in failed_checks(replace(law, name="twice")))
