"""Chi square of nested models is ordered: an extension is never worse than its special case, nor the latter stuck above it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FitContext, FittedModel, candidates_on
from rigsight.diagnose.search.nested_models import (
    at_least_as_good,
    lowered_by_extensions,
    ordered_by_inclusion,
)
from rigsight.diagnose.search.possible_cause import has_size_of_zero
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.diagnose.search.starts import start_values
from rigsight.effects import CATALOGUE, Effect, effect_named
from rigsight.identify import characteristic_scales, off_bounds
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT, N, NOISE = 0.01, 800, 1e-4
COULOMB, STRIBECK = effect_named("coulomb_friction"), effect_named("stribeck_friction")
TRUE = {"gain": 1.0, "m": 1.0, "d": 0.5, "k": 40.0, "x_off": 0.0, "force_off": 0.0, "T_c": 0.3}
HELD = frozenset({"force_off"})


def bench_with(*effects: Effect, modelled: tuple[Effect, ...] = ()) -> FitContext:
    rng, t, records = np.random.default_rng(7), DT * np.arange(N), []
    for number in range(2):
        u = sum(
            (2.0 + number) * np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.0)) for f in (0.3, 0.7, 1.1, 1.9)
        )
        asked = Record(f"run {number}", DT, {"u": np.asarray(u)}, {}, hold="foh")
        x = simulate(compose(AXIS, effects), TRUE, asked)["x"]
        records.append(asked.with_signals(x=x + rng.normal(scale=NOISE, size=N)))
    runs = tuple(records)
    scales = characteristic_scales(AXIS, runs, TRUE)
    start = {name: value for name, value in TRUE.items() if name != "T_c" or modelled}
    return FitContext(AXIS, runs, runs, runs, scales, {"x": NOISE}, HELD, start, modelled=modelled)


@pytest.fixture(scope="module")
def linear() -> tuple[FitContext, FittedModel]:
    bench = bench_with()
    return bench, reidentify(bench, bench.start)


@pytest.fixture(scope="module")
def dry() -> FitContext:
    return bench_with(COULOMB)


def stuck(bench: FitContext, effect: Effect, base: FittedModel) -> FittedModel:
    """Return a candidate far from any minimum: the strongest of its declared starts, on a rig that is too heavy."""
    structure = bench.simplest((effect,))
    *_, start = start_values(bench, structure, effect, base.fit, {})
    free = bench.free_parameters(structure)
    return bench.score(
        (effect,),
        bench.problem(structure, bench.estimation).fit({**start, "m": 3.0}, free, max_evaluations=1),
    )


ON_AXIS = [
    effect
    for effect in candidates_on(AXIS, CATALOGUE)
    if not effect.parents
    or not set(effect.parents) & {e.name for e in CATALOGUE}
    or effect.starts[0].parent is None
]


@pytest.mark.parametrize("effect", ON_AXIS, ids=lambda effect: effect.name)
def test_no_effect_ends_above_the_equations_without_it(
    linear: tuple[FitContext, FittedModel], effect: Effect
) -> None:
    bench, base = linear
    model = at_least_as_good(bench, stuck(bench, effect, base), base)
    if set(base.fit.free) <= set(model.fit.free):
        assert model.fit.cost <= (1.0 + 1e-6) * base.fit.cost


@pytest.mark.slow
def test_an_extension_is_at_least_as_good_as_its_special_case(dry: FitContext) -> None:
    base = reidentify(dry, dry.start)
    structure = dry.composed((COULOMB,))
    fit = dry.problem(structure, dry.estimation).fit(TRUE, dry.free_parameters(structure))
    coulomb = dry.score((COULOMB,), fit)
    models = {m.names[0]: m for m in ordered_by_inclusion(dry, base, [stuck(dry, STRIBECK, base), coulomb])}
    assert models["stribeck_friction"].fit.cost <= (1.0 + 1e-6) * models["coulomb_friction"].fit.cost
    assert models["coulomb_friction"].error_over_noise < 1.1


def test_equations_in_a_worse_minimum_are_refitted_from_what_contains_them() -> None:
    bench = bench_with(COULOMB, modelled=(COULOMB,))
    structure, cubic = bench.composed(), effect_named("cubic_stiffness")
    problem, free = bench.problem(structure, bench.estimation), bench.free_parameters(structure)
    stopped = bench.score((), problem.fit({**TRUE, "m": 1.4, "d": 2.0, "T_c": 0.0}, free, max_evaluations=1))
    larger = bench.composed((cubic,))
    fit = bench.problem(larger, bench.estimation).fit({**TRUE, "k_3": 0.0}, bench.free_parameters(larger))
    lowered = lowered_by_extensions(bench, stopped, [bench.score((cubic,), fit)])
    assert stopped.error_over_noise > 10.0
    assert lowered.error_over_noise < 1.1
    assert lowered.fit.values["T_c"] == pytest.approx(TRUE["T_c"], rel=0.02)


def test_parameters_given_at_a_bound_start_inside(dry: FitContext) -> None:
    structure = dry.composed((COULOMB,))
    free = dry.free_parameters(structure)
    moved = off_bounds(structure, {**TRUE, "d": 0.0, "T_c": 0.0}, free, dry.scales)
    assert moved is not None
    assert 0.0 < moved["d"] < 10.0
    assert 0.0 < moved["T_c"] < 3.0
    assert {name: value for name, value in moved.items() if name not in ("d", "T_c")} == {
        name: value for name, value in TRUE.items() if name not in ("d", "T_c")
    }
    assert off_bounds(structure, TRUE, free, dry.scales) is None


def test_a_size_of_zero_is_no_cause(linear: tuple[FitContext, FittedModel], dry: FitContext) -> None:
    bench, base = linear
    absent = at_least_as_good(bench, stuck(bench, effect_named("cubic_stiffness"), base), base)
    assert has_size_of_zero(absent, [base])
    structure = dry.composed((COULOMB,))
    problem, free = dry.problem(structure, dry.estimation), dry.free_parameters(structure)
    present, without = dry.score((COULOMB,), problem.fit(TRUE, free)), reidentify(dry, dry.start)
    assert not has_size_of_zero(present, [without])
    # Determined only together with a mass and a stiffness, it still is no zero: without it the equations leave far more.
    with_others = replace(present, fit=replace(present.fit, standard_errors=dict.fromkeys(free, np.inf)))
    assert not has_size_of_zero(with_others, [without])
    assert has_size_of_zero(with_others, [replace(without, fit=replace(without.fit, cost=present.fit.cost))])


def test_sizes_of_one_effect_count_together(linear: tuple[FitContext, FittedModel]) -> None:
    """Sine and cosine of a ripple share its amplitude: each may be near zero while the amplitude is not."""
    bench, base = linear
    model = stuck(bench, effect_named("torque_ripple"), base)
    names = ["T_sin", "T_cos"]
    at = [model.fit.free.index(name) for name in names]
    covariance = model.fit.covariance.copy()
    covariance[np.ix_(at, at)] = np.array([[1.0, -0.98], [-0.98, 1.0]])
    errors = {**model.fit.standard_errors, **dict.fromkeys(names, 1.0)}

    def with_sizes(sine: float, cosine: float) -> FittedModel:
        values = {**model.fit.values, "T_sin": sine, "T_cos": cosine}
        return replace(
            model, fit=replace(model.fit, values=values, covariance=covariance, standard_errors=errors)
        )

    assert not has_size_of_zero(with_sizes(2.0, 2.0), [])
    assert has_size_of_zero(with_sizes(2.0, -2.0), [])
