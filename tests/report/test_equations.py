from __future__ import annotations

import html
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations
from xml.dom import minidom

import pytest
import sympy as sp

from rigsight.diagnose.result import Diagnosis
from rigsight.effects import CATALOGUE, Effect, effect_named, placed
from rigsight.effects.symbols import load, v, x
from rigsight.report.labels import effect_label, sentence_case
from rigsight.report.render import equation_groups, equations_of, known_effects
from rigsight.rigs import RIGS


def groups(diagnosis: Diagnosis, rig: str, effects: Sequence[Effect]) -> dict[str, list[str]]:
    own = replace(diagnosis, rig=rig, effects=tuple(effect.name for effect in effects), model={})
    return {
        group.title: [spoken(equation) for equation in group.equations]
        for group in equation_groups(own, known_effects(effects))
    }


def spoken(equation: str) -> str:
    """Return the letters of an equation in their order; raises where it is not well-formed."""
    # HTML knows the names of letters that XML does not.
    plain = re.sub(r"&(?!lt;|gt;|amp;|#)\w+;", lambda name: html.unescape(name[0]), equation)
    document = minidom.parseString(plain.replace("\u2062", " "))

    def letters(node: minidom.Node) -> str:
        return node.data if node.nodeType == node.TEXT_NODE else " ".join(map(letters, node.childNodes))

    return " ".join(letters(document).split())


@pytest.mark.parametrize("rig", [name for name, rig in RIGS.items() if rig.has_one_motion])
def test_every_effect_has_equations_on_every_rig_that_offers_it(diagnosis: Diagnosis, rig: str) -> None:
    for effect in CATALOGUE:
        if RIGS[rig].offers(effect):
            found = groups(diagnosis, rig, [effect])
            assert len(found) == 2, effect.name
            _, (title, equations) = found.items()
            assert title == sentence_case(effect_label(effect.name))
            own_rates = {state.rate for state in effect.states} & {state.symbol for state in effect.states}
            shown = 1 + len(effect.states) - len(own_rates) + effect.reads(load)
            assert len(equations) == shown, effect.name


def test_a_state_that_is_the_rate_of_another_is_shown_with_a_dot(diagnosis: Diagnosis) -> None:
    found = groups(diagnosis, "axis", [effect_named("flexible_mode")])["Flexible mode"]
    assert found[1].startswith("q ¨ =")
    assert "− q ˙" in found[1]


def test_two_effects_whose_symbols_are_alike_are_told_apart(diagnosis: Diagnosis) -> None:
    found = groups(diagnosis, "axis", [effect_named("backlash"), effect_named("bouc_wen_hysteresis")])
    assert found["Backlash"][1].startswith("z ˙ backlash =")
    assert found["Bouc-Wen hysteresis"][1].startswith("z ˙ Bouc-Wen hysteresis =")


def test_delays_stand_where_the_simulation_has_them(diagnosis: Diagnosis) -> None:
    chosen = [effect_named(name) for name in ("input_dead_zone", "input_delay", "sensor_lag", "sensor_delay")]
    found = groups(diagnosis, "axis", chosen)
    assert found["Input delay"] == ["u input delay = u ( t − T d )"]
    assert found["Sensor delay"] == ["x sensor delay = x sensor lag ( t − T s )"]
    assert found["Axis"][-1] == "x measured = x sensor delay"


def test_the_linear_rig_is_the_thesis_s(diagnosis: Diagnosis) -> None:
    (equations,) = groups(diagnosis, "running_gear", []).values()
    assert equations == [
        "J z ψ ¨ = b k τ u r 0 − k d ψ ˙ − k c ( ψ − ψ off )",
        "y ˙ = c y v ( ψ − y − y off 2 l 0 )",
    ]


def test_the_displacement_of_an_axis_is_not_the_effects_displacement_from_rest(diagnosis: Diagnosis) -> None:
    assert groups(diagnosis, "axis", [])["Axis"] == ["m x ¨ = gain u − d x ˙ − k ( x − x off ) + force off"]
    assert groups(diagnosis, "element", [])["Element"] == ["force = d x ˙ + k x + force off"]


def test_an_effect_takes_its_place_in_the_rig_s_equation(diagnosis: Diagnosis) -> None:
    found = groups(diagnosis, "running_gear", [effect_named("cubic_stiffness")])
    assert found["Cubic stiffness"] == ["T cubic\u00a0stiffness = k 3 ( ψ − ψ off ) 3".replace("\u00a0", " ")]
    assert found["Running gear"][0].endswith("− T cubic stiffness")


def test_effects_are_chained_along_the_signal_path_whatever_their_order(diagnosis: Diagnosis) -> None:
    chosen = [effect_named(name) for name in ("bouc_wen_hysteresis", "free_play", "input_saturation")]
    first, *others = (groups(diagnosis, "running_gear", order) for order in permutations(chosen))
    assert all(other == first for other in others)
    play, loop = first["Free play"], first["Bouc-Wen hysteresis"]
    assert play[0].startswith("x spring, free play =")
    assert "k c x spring, free play" in loop[0], "the hysteresis sees what the play leaves"
    assert "x ˙ spring, free play" in loop[1]
    assert "u input saturation" in first["Running gear"][0]


def shown_of(rig: str, *effects: str) -> dict[str, list[str]]:
    chosen = [
        placed(effect_named(kind), place) for kind, _, place in (name.partition("@") for name in effects)
    ]
    return {g.title: [spoken(equation) for equation in g.equations] for g in equations_of(RIGS[rig], chosen)}


def test_each_coordinate_has_a_line_and_an_effect_acts_where_it_is() -> None:
    found = shown_of("drive_train", "coulomb_friction@load_bearing")
    motor, load, *sensors = found["Drive train"]
    assert motor == "J m φ ¨ m = k t u − d s ( φ ˙ m − φ ˙ l ) − k s ( φ m − φ l ) − d m φ ˙ m"
    assert load.startswith("J l φ ¨ l = d s")
    assert load.endswith("− k l φ l − T Coulomb friction at load_bearing")
    assert sensors == ["motor angle = φ m", "load angle = φ l"]
    assert found["Coulomb friction at load_bearing"] == [
        "T Coulomb friction at load_bearing = T c sign ( φ ˙ l )"
    ]


def test_masses_that_depend_on_the_coordinates_stand_before_their_accelerations() -> None:
    first, second, *_ = shown_of("two_link_arm")["Two link arm"]
    assert first.startswith(
        "( I 1 + I 2 + l 1 2 m 2 + 2 l 1 s 2 cos ( q 2 ) ) q ¨ 1 + ( I 2 + l 1 s 2 cos ( q 2 ) ) q ¨ 2 = τ 1 − d 1 q ˙ 1"
    )
    assert second.startswith("( I 2 + l 1 s 2 cos ( q 2 ) ) q ¨ 1 + I 2 q ¨ 2 = τ 2 − d 2 q ˙ 2")


def test_a_control_law_has_a_line_and_reads_its_sensor_behind_the_effects() -> None:
    found = shown_of("servo", "sensor_lag@angle", "input_saturation@motor")
    assert "motor = clip ( k p ( goal − angle sensor lag ) , -1 , 1 )" in found["Servo"]
    assert found["Servo"][0].startswith("( J + l 2 m ) q ¨ = k v motor input saturation")
    assert found["Input saturation at motor"] == ["motor input saturation = clip ( motor , − u max , u max )"]


def test_a_user_s_own_effect_shows_its_declared_torque(diagnosis: Diagnosis) -> None:
    c = sp.Symbol("c_own", real=True)
    template = effect_named("cubic_stiffness")
    own = replace(
        template, name="my_gear", torque=c * x**2 * sp.tanh(v), parameters=(replace(template.parameters[0], name="c_own"),)
    )  # fmt: skip
    assert groups(diagnosis, "axis", [own])["My gear"] == ["T my gear = c own ( x − x off ) 2 tanh ( x ˙ )"]


def test_an_effect_that_nobody_declared_leaves_the_equations_out(diagnosis: Diagnosis) -> None:
    assert equation_groups(replace(diagnosis, effects=("my_gear",)), known_effects()) == []
