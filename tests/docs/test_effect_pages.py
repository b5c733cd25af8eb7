"""The page of an effect says what its declaration says: equation, parameters, pictures, none missed."""

from __future__ import annotations

import re
from collections.abc import Callable
from types import ModuleType
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from rigsight.effects import CATALOGUE, Effect, effect_named

Hook = Callable[[str], ModuleType]

HEADINGS = (
    "Equation",
    "Parameters",
    "Signature",
    "When it applies",
    "How to distinguish it from similar effects",
    "References",
)


@pytest.fixture
def few_frequencies(hook: Hook, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The sine tests behind the pictures at a few frequencies: far below, at and above the resonance."""
    tests = hook("sine_tests")
    monkeypatch.setattr(tests, "FREQUENCIES", np.array([2.0, 10.0, 40.0]))
    return tests


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)
def test_every_effect_has_a_page_with_every_part(hook: Hook, effect: Effect) -> None:
    page = hook("effect_pages").effect_page(effect)
    found = dict(re.findall(r"^## ([^\n]+)\n\n(.+?)(?=^## |\Z)", page, re.MULTILINE | re.DOTALL))
    assert tuple(found) == HEADINGS
    assert effect.summary in page
    own_rates = {state.rate for state in effect.states} & {state.symbol for state in effect.states}
    assert found["Equation"].count('<math display="block">') >= 1 + 1 + len(effect.states) - len(own_rates)
    for parameter in effect.parameters:
        (row,) = re.findall(rf"^\| `{parameter.name}` \|.*$", found["Parameters"], re.MULTILINE)
        assert parameter.description in row
    for parent in effect.parents:
        assert f"({parent}.md)" in found[HEADINGS[4]]
    assert "Signature:" not in found["Signature"]
    assert "``" not in page


def test_the_index_and_the_neighbors_link_to_pages_that_exist(hook: Hook) -> None:
    pages = hook("effect_pages")
    names = {effect.name for effect in CATALOGUE}
    assert set(re.findall(r"\((\w+)\.md\)", pages.index_page())) == names
    for effect in CATALOGUE:
        assert set(re.findall(r"\]\((\w+)\.md\)", pages.effect_page(effect))) <= names - {effect.name}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["coulomb_friction", "input_delay"])
def test_the_pictures_of_a_page_are_drawn(hook: Hook, few_frequencies: ModuleType, name: str) -> None:
    effect = effect_named(name)
    drawn = hook("effect_figures").figures(effect)
    linked = re.findall(rf"\({name}-(\d-\w+)\.svg#only-(\w+)\)", hook("effect_pages").effect_page(effect))
    assert [end for end, _ in linked] == list(drawn)
    for end, scheme in linked:
        assert end.endswith(scheme)
        letters = " ".join(ET.fromstring(drawn[end]).itertext())
        assert "linear" in letters
        assert "with the effect" in letters
        assert "[" in letters, "axes have units"
    assert drawn["1-light"] != drawn["1-dark"]


def test_a_picture_shows_the_signature(few_frequencies: ModuleType) -> None:
    gain, loop = few_frequencies.panels(effect_named("coulomb_friction"))
    linear, small, _, large = (line.y for line in gain.lines)
    assert np.max(np.nan_to_num(small)) < 0.9 * np.max(linear), "friction holds a small motion"
    assert large[1] > 0.8 * linear[1], "and hardly a large one"
    areas = [abs(np.trapezoid(line.y, line.x)) for line in loop.lines]
    assert areas[-1] > 1.5 * areas[-2], "the loop with friction is wider than the viscous one"
    gain, phase = few_frequencies.panels(effect_named("input_delay"))
    np.testing.assert_allclose(gain.lines[1].y, gain.lines[0].y, rtol=1e-3)
    late = phase.lines[0].y - phase.lines[1].y
    np.testing.assert_allclose(
        late / late[0], few_frequencies.FREQUENCIES / few_frequencies.FREQUENCIES[0], rtol=1e-2
    )


def test_a_docstring_without_a_part_is_refused(hook: Hook, monkeypatch: pytest.MonkeyPatch) -> None:
    import rigsight.effects.backlash as module

    monkeypatch.setattr(module, "__doc__", (module.__doc__ or "").replace("Signature:", "It shows:"))
    with pytest.raises(ValueError, match="backlash says nothing under: signature"):
        hook("effect_text").effect_text(effect_named("backlash"))
