"""A fit of friction that ended in a wrong basin is taken to the lowest one; a right one, and one that is good enough, stay."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.search import nested_models
from rigsight.diagnose.search.nested_models import in_lowest_basins
from rigsight.effects import Effect, effect_named
from rigsight.identify import characteristic_scales
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT, N, NOISE = 0.01, 2000, 2e-5
STRIBECK = effect_named("stribeck_friction")
TRUE = {
    "gain": 1.0,
    "m": 0.076,
    "d": 0.041,
    "k": 1.74,
    "x_off": 0.0,
    "force_off": 0.0,
    "T_c": 1.6e-3,
    "T_s": 2.8e-3,
    "w_s": 0.013,
}


@pytest.fixture(scope="module")
def bench() -> FitContext:
    rng, t, records = np.random.default_rng(4), DT * np.arange(N), []
    for number in range(3):
        u = sum(4e-3 * np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.0)) for f in np.arange(0.1, 1.6, 0.13))
        asked = Record(f"run {number}", DT, {"u": np.asarray(u)}, {}, hold="foh")
        x = simulate(compose(AXIS, (STRIBECK,)), TRUE, asked)["x"]
        records.append(asked.with_signals(x=x + rng.normal(scale=NOISE, size=N)))
    runs = tuple(records)
    scales = characteristic_scales(AXIS, runs, TRUE)
    return FitContext(AXIS, runs, runs, runs, scales, {"x": NOISE}, frozenset(), TRUE)


def fitted(
    bench: FitContext, effect: Effect, start: Mapping[str, float], evaluations: int = 60
) -> FittedModel:
    structure = bench.composed((effect,))
    problem = bench.problem(structure, bench.estimation)
    fit = problem.fit(start, bench.free_parameters(structure), max_evaluations=evaluations)
    return bench.score((effect,), fit)


@pytest.mark.slow
def test_a_fit_that_stopped_elsewhere_is_taken_to_the_lowest_basin(bench: FitContext) -> None:
    stopped = fitted(bench, STRIBECK, {**TRUE, "T_c": 1e-3, "T_s": 5e-3, "w_s": 0.05}, 2)
    assert stopped.error_over_noise > 2.0
    (found,) = in_lowest_basins(bench, [stopped])
    assert found.error_over_noise < 1.05
    assert found.fit.values["T_s"] == pytest.approx(TRUE["T_s"], rel=0.02)


@pytest.mark.slow
def test_a_fit_at_the_floor_is_left_alone(bench: FitContext) -> None:
    model = fitted(bench, STRIBECK, TRUE)
    assert in_lowest_basins(bench, [model])[0] is model


def test_a_wrong_effect_keeps_the_only_basin_that_it_has(bench: FitContext) -> None:
    model = fitted(bench, effect_named("cubic_stiffness"), {**TRUE, "k_3": 0.1})
    assert model.error_over_noise > 2.0
    assert in_lowest_basins(bench, [model])[0] is model


@pytest.mark.slow
def test_a_rival_beside_wrong_numbers_of_the_rig_gets_those_of_the_best(bench: FitContext) -> None:
    coulomb = effect_named("coulomb_friction")
    best, right = fitted(bench, STRIBECK, TRUE), fitted(bench, coulomb, {**TRUE, "T_c": 2e-3})
    stuck = fitted(bench, coulomb, {**TRUE, "T_c": 2e-3, "k": 3.0, "m": 0.3}, 1)
    assert best.error_over_noise < 1.03
    assert stuck.error_over_noise > 2.0 * right.error_over_noise
    same, found = in_lowest_basins(bench, [best, stuck])
    assert same is best
    assert found.error_over_noise < 1.2 * right.error_over_noise


@pytest.mark.slow
def test_a_rival_of_several_effects_gets_the_effect_that_both_have(bench: FitContext) -> None:
    def both(other: str, own: Mapping[str, float], evaluations: int) -> FittedModel:
        effects = (STRIBECK, effect_named(other))
        structure = bench.composed(effects)
        problem = bench.problem(structure, bench.estimation)
        fit = problem.fit({**TRUE, **own}, bench.free_parameters(structure), max_evaluations=evaluations)
        return bench.score(effects, fit)

    best = both("cubic_stiffness", {"k_3": 1e-3}, 60)
    stopped = both("quadratic_damping", {"c_2": 1e-3, "T_c": 1e-3, "T_s": 5e-3, "w_s": 0.05}, 2)
    assert best.error_over_noise < 1.03
    assert stopped.error_over_noise > 2.0
    same, found = in_lowest_basins(bench, [best, stopped])
    assert same is best
    assert found.error_over_noise < 1.03
    assert found.fit.values["T_s"] == pytest.approx(TRUE["T_s"], rel=0.02)


@pytest.mark.slow
def test_the_best_one_starts_from_the_numbers_of_the_next_too(
    bench: FitContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = fitted(bench, STRIBECK, TRUE)
    next_one = fitted(bench, effect_named("coulomb_friction"), {**TRUE, "T_c": 2e-3})
    asked: dict[tuple[str, ...], list[Mapping[str, float]]] = {}

    def noted(_: FitContext, own: FittedModel, starts: list[tuple[Mapping[str, float], None]]) -> FittedModel:
        asked[own.names] = [values for values, _ in starts]
        return own

    monkeypatch.setattr(nested_models, "in_lowest_basin", noted)
    in_lowest_basins(bench, [next_one, best])
    (start,) = asked[best.names]
    assert start["k"] == next_one.fit.values["k"] != best.fit.values["k"]
    assert start["T_s"] == best.fit.values["T_s"]
    (start,) = asked[next_one.names]
    assert start["k"] == best.fit.values["k"]
    # Coulomb friction is a special case of Stribeck friction.
    assert start["T_c"] == best.fit.values["T_c"] != next_one.fit.values["T_c"]
