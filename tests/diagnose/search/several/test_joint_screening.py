"""Effects that explain a residual together are found whichever is strongest, and none with a size that it cannot have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigsight.diagnose.policy import SEARCH
from rigsight.diagnose.search.screening import Response
from rigsight.diagnose.search.together import best_sets
from rigsight.effects import effect_named

RNG = np.random.default_rng(4)
COLUMNS = RNG.standard_normal((6, 500))
FRICTION, DAMPING, SPRING, DELAY = (
    effect_named(name) for name in ("coulomb_friction", "quadratic_damping", "cubic_stiffness", "input_delay")
)
HYSTERESIS = effect_named("bouc_wen_hysteresis")


def response(name: str, own: float, column: np.ndarray) -> Response:
    effect = effect_named(name)
    values = {p.name: own if p.null is not None else 1.0 for p in effect.parameters}
    return Response(effect, values, column)


def test_three_effects_are_found_although_a_fourth_explains_more_than_any_of_them() -> None:
    friction, damping, spring, delay = COLUMNS[:4]
    residual = 2.0 * friction + 2.0 * damping + 2.0 * spring
    imitation = residual + 6.0 * COLUMNS[5]
    responses = [
        response("coulomb_friction", 0.1, friction),
        response("quadratic_damping", 0.1, damping),
        response("cubic_stiffness", 0.1, spring),
        response("input_delay", 0.1, delay),
        response("bouc_wen_hysteresis", 0.1, imitation),
    ]
    unit = [r.column / np.linalg.norm(r.column) for r in responses]
    alone = [float(column @ residual) ** 2 / float(residual @ residual) for column in unit]
    best = best_sets(responses, residual, 3)[0]
    assert best.names == {"coulomb_friction", "quadratic_damping", "cubic_stiffness"}
    assert best.share > 0.999 > max(alone)
    np.testing.assert_allclose([next(iter(own.values())) for own in best.values], 0.2, rtol=1e-9)


def test_a_friction_that_would_have_to_drive_is_in_no_set() -> None:
    friction, damping, spring = COLUMNS[:3]
    residual = -2.0 * friction + 1.0 * damping - 0.5 * spring
    responses = [
        response("coulomb_friction", 0.1, friction),
        response("quadratic_damping", 0.1, damping),
        response("cubic_stiffness", 0.1, spring),
    ]
    names = [found.names for found in best_sets(responses, residual, 2)]
    assert names == [{"quadratic_damping", "cubic_stiffness"}]
    assert best_sets(responses, residual, 3) == []


def test_starts_that_differ_in_size_only_count_once() -> None:
    friction, spring = COLUMNS[:2]
    residual = friction + spring + 0.01 * COLUMNS[2]
    responses = [
        response("coulomb_friction", 0.1, friction),
        response("coulomb_friction", 0.3, 3.0 * friction),
        response("cubic_stiffness", 0.1, spring),
        response("cubic_stiffness", 0.1, COLUMNS[3]),
    ]
    found = best_sets(responses, residual, 2)
    assert [one.names for one in found] == [{"coulomb_friction", "cubic_stiffness"}] * 2
    assert found[0].share > 0.99 > found[1].share


def test_an_effect_with_many_starts_leaves_room_for_others(monkeypatch) -> None:
    monkeypatch.setattr("rigsight.diagnose.search.together.SEARCH", replace(SEARCH, joint_beam=3))
    friction, damping, spring = COLUMNS[:3]
    starts = [friction + 1e-2 * RNG.standard_normal(500) for _ in range(9)]
    responses = [
        *(response("coulomb_friction", 0.1, start) for start in starts),
        response("cubic_stiffness", 0.1, spring),
        response("quadratic_damping", 0.1, damping),
    ]
    found = best_sets(responses, 3.0 * friction + 3.0 * spring + damping, 2)
    best = {"coulomb_friction", "cubic_stiffness"}
    assert [one.names == best for one in found] == [True, True, False]


def test_without_responses_there_are_no_sets() -> None:
    assert best_sets([], COLUMNS[0], 2) == []
    assert best_sets([response("coulomb_friction", 0.1, COLUMNS[0])], COLUMNS[1], 2) == []
    assert best_sets([response("coulomb_friction", 0.1, COLUMNS[0])], np.zeros(500), 2) == []


def test_a_response_that_runs_away_is_in_no_set() -> None:
    friction, damping, spring = COLUMNS[:3]
    responses = [
        response("coulomb_friction", 0.1, friction),
        response("quadratic_damping", 0.1, damping),
        response("cubic_stiffness", 0.1, 1e200 * spring),
    ]
    found = best_sets(responses, friction + damping, 2)
    assert [one.names for one in found] == [{"coulomb_friction", "quadratic_damping"}]
