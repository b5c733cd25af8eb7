"""Which of the effects that a matrix leaves open a further record is planned for."""

from __future__ import annotations

from rigsight.check import Told, Visible, holes_of
from rigsight.check.effect_matrix import EffectMatrix
from rigsight.effects import Family

FAMILIES = (
    Family.DRY_FRICTION,
    Family.DRY_FRICTION,
    Family.DAMPING_LAW,
    Family.PLAY_AND_STOPS,
    Family.DELAY_OR_LAG,
)


def matrix(told: dict[tuple[int, int], Told], visible: tuple[Visible, ...] = ("yes",) * 5) -> EffectMatrix:
    rows = tuple(
        tuple(told.get((max(i, j), min(i, j)), "apart") for j in range(len(FAMILIES)))
        for i in range(len(FAMILIES))
    )
    return EffectMatrix(tuple("abcde"), FAMILIES, ("joint",) * 5, visible, rows)


def test_where_all_are_told_apart_there_is_no_hole() -> None:
    # Forms of one family may be alike.
    assert holes_of(matrix({(1, 0): "alike"}), 4).effects == ()


def test_pairs_that_another_motion_tells_apart_come_before_those_that_push_alike() -> None:
    found = holes_of(matrix({(2, 0): "other motion", (4, 3): "alike"}), 4)
    assert set(found.effects) == {"a", "c"}
    assert (found.hidden, found.others) == (False, ("d", "e"))


def test_one_form_of_each_family_and_no_more_than_asked() -> None:
    open_ones: dict[tuple[int, int], Told] = {
        (2, 0): "other motion",
        (2, 1): "other motion",
        (3, 2): "alike",
        (4, 2): "by size",
    }
    assert holes_of(matrix(open_ones), 4).effects == ("c", "a", "e", "d")
    assert holes_of(matrix(open_ones), 3).effects == ("c", "a", "e")


def test_what_does_not_show_has_no_effect_as_its_rival() -> None:
    found = holes_of(matrix({}, ("yes", "yes", "no", "yes", "at some sizes")), 2)
    assert (found.effects, found.hidden, found.others) == (("c",), True, ("e",))
