"""Errors of the bootstrap: those of the formula where it holds, wider and true where a force decides when friction slips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import rigsight.diagnose.bootstrap as bootstrap
from rigsight.diagnose.bootstrap import uncertainty_of
from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.policy import BOOTSTRAP
from rigsight.diagnose.replicates import Sources, colored, likeliest_sources
from rigsight.effects import Effect, effect_named
from rigsight.errors import SimulationError
from rigsight.identify import FitResult, characteristic_scales
from rigsight.records import Record
from rigsight.rigs import AXIS, Rig
from rigsight.simulate import compose, simulate
from rigsight.simulate.input_hold import Hold

from ...tiers import slow_but

DT, N = 0.01, 2000
VALUES = {"gain": 1.0, "m": 1.0, "d": 0.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
FRICTION = effect_named("coulomb_friction")


def fitted(
    effects: Sequence[Effect], own: dict[str, float], noise: float, force: float, corner: float, seed: int
) -> tuple[FitContext, FitResult]:
    """The true model fitted to three runs of many tones beside a force from outside that nobody records."""
    rng, t = np.random.default_rng(seed), DT * np.arange(N)
    structure, records = compose(AXIS, effects), []
    for number in range(3):
        u = sum(0.3 * np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.0)) for f in np.arange(0.4, 4.0, 0.3))
        asked = Record(f"run {number}", DT, {"u": np.asarray(u)}, {}, hold="foh")
        pushed = asked.with_signals(u=u + force * colored((N,), corner * DT, rng))
        x = simulate(structure, {**VALUES, **own}, pushed)["x"]
        records.append(asked.with_signals(x=x + rng.normal(scale=noise, size=N)))
    scales = characteristic_scales(AXIS, records, VALUES)
    runs = tuple(records)
    bench = FitContext(AXIS, runs, runs, runs, scales, {"x": noise}, frozenset(), VALUES)
    bench_structure = bench.composed(effects)
    problem = bench.problem(bench_structure, bench.estimation)
    return bench, problem.fit({**VALUES, **own}, bench.free_parameters(bench_structure))


def test_it_is_the_formula_on_a_linear_rig_with_white_noise() -> None:
    bench, fit = fitted((), {}, 1e-4, 0.0, np.inf, 1)
    found = uncertainty_of(bench, fit, np.random.default_rng(0), 200)
    assert found.method == "bootstrap"
    ratios = [found.std[name] / fit.standard_errors[name] for name in fit.free]
    # 200 draws scatter by 5 %. Sizes of forces are not negative, so that by chance a little is found where there is none.
    assert np.median(ratios) == pytest.approx(1.0, abs=0.15)
    assert 0.8 < min(ratios) < max(ratios) < 1.4
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx([found.std[name] for name in fit.free])


@pytest.mark.slow
def test_errors_of_friction_under_a_slow_force_are_wider_and_true() -> None:
    before, after = [], []
    for seed in range(3, 9):
        bench, fit = fitted((FRICTION,), {"T_c": 0.3}, 1e-5, 0.005, 2.0, seed)
        found = uncertainty_of(bench, fit, np.random.default_rng(0))
        off = {name: fit.values[name] - {**VALUES, "T_c": 0.3}[name] for name in fit.free}
        before += [abs(off[name]) / fit.standard_errors[name] for name in fit.free]
        after += [abs(off[name]) / found.std[name] for name in fit.free]
    assert np.mean(np.array(before) <= 2.0) < 0.85
    assert np.mean(np.array(after) <= 2.0) >= 0.85
    assert np.median(np.array(before) / np.array(after)) > 1.2


@pytest.mark.slow
def test_the_same_seed_draws_the_same() -> None:
    bench, fit = fitted((FRICTION,), {"T_c": 0.1}, 1e-4, 0.01, 10.0, 1)
    one, same, other = (uncertainty_of(bench, fit, np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert one.std == same.std
    assert one.std != other.std
    assert list(one.std.values()) == pytest.approx(
        list(other.std.values()), rel=5.0 / np.sqrt(2.0 * BOOTSTRAP.replicates)
    )


def test_a_model_that_cannot_be_simulated_under_forces_keeps_the_formula(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench, fit = fitted((), {}, 1e-4, 0.0, np.inf, 1)

    def fails(*_: object) -> None:
        raise SimulationError("The motion left the range of numbers.")

    monkeypatch.setattr(bootstrap.Replicates, "responses", fails)
    found = uncertainty_of(bench, fit, np.random.default_rng(0))
    assert found.method == "formula"
    assert found.std == fit.standard_errors


def test_a_model_that_takes_too_long_keeps_the_formula(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, fit = fitted((), {}, 1e-4, 0.0, np.inf, 1)
    monkeypatch.setattr(bootstrap, "BOOTSTRAP", replace(BOOTSTRAP, most_replicate_steps=10))
    assert uncertainty_of(bench, fit, np.random.default_rng(0)).method == "formula"


def test_what_the_records_do_not_determine_stays_undetermined() -> None:
    bench, fit = fitted((), {}, 1e-4, 0.0, np.inf, 1)
    covariance = fit.covariance.copy()
    covariance[0, :] = covariance[:, 0] = 0.0
    covariance[0, 0] = np.inf
    open_ = replace(fit, covariance=covariance, standard_errors={**fit.standard_errors, fit.free[0]: np.inf})
    found = uncertainty_of(bench, open_, np.random.default_rng(0))
    assert found.std[fit.free[0]] == np.inf
    assert all(np.isfinite(found.std[name]) for name in fit.free[1:])


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "force"), slow_but((1e-5, 0.02), of=[(1e-3, 0.0), (1e-5, 0.02)]))
def test_an_observer_has_errors_of_the_size_that_fits_scatter_by(noise: float, force: float) -> None:
    """A cart without a spring: an observer follows noise too, and its own errors die away."""
    off, errors = [], []
    for seed in range(10):
        bench, fit = _followed(AXIS, noise, force, seed)
        found = uncertainty_of(bench, fit, np.random.default_rng(0))
        assert found.method == "bootstrap"
        off.append(fit.values["m"] - 1.0)
        errors.append(found.std["m"])
    # Ten draws tell their spread to a quarter.
    assert 0.6 < np.median(errors) / np.sqrt(np.mean(np.square(off))) < 1.7


@pytest.mark.slow
def test_an_observed_record_of_an_analog_input_has_errors_from_the_bootstrap() -> None:
    """Forces change faster than the input, so that they have more pieces in a sample."""
    bench, fit = _followed(AXIS, 1e-3, 0.02, seed=0, hold="band_limited")
    assert uncertainty_of(bench, fit, np.random.default_rng(0)).method == "bootstrap"


def _followed(
    rig: Rig, noise: float, force: float, seed: int, hold: Hold = "foh"
) -> tuple[FitContext, FitResult]:
    rng, t = np.random.default_rng(seed), DT * np.arange(N)
    own = {**VALUES, "k": 0.0}
    records = []
    for _ in range(2):
        u = sum(0.3 * np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.0)) for f in np.arange(0.4, 4.0, 0.3))
        asked = Record("run", DT, {"u": np.asarray(u)}, {}, hold=hold)
        pushed = asked.with_signals(u=u + force * colored((N,), np.inf, rng))
        x = simulate(compose(rig), own, pushed)["x"] + rng.normal(scale=noise, size=N)
        records.append(replace(asked.with_signals(x=x), observed={"x": 5.0}))
    runs = tuple(records)
    scales = characteristic_scales(rig, runs, own)
    held = frozenset({"k", "x_off", "force_off"})
    bench = FitContext(rig, runs, runs, runs, scales, {"x": noise}, held, own)
    structure = bench.composed()
    return bench, bench.problem(structure, runs).fit(own, ["m", "d"])


def test_sizes_of_forces_and_noise_are_found_again() -> None:
    rng, dt, corners = np.random.default_rng(1), 0.01, np.array([np.inf, 3.0])

    def shown(force: np.ndarray) -> np.ndarray:
        # A mass that a spring holds, by its impulse response: no simulation.
        t = dt * np.arange(500)
        response = np.exp(-0.5 * t) * np.sin(10.0 * t) / 10.0 * dt
        return np.stack([np.convolve(own, response)[: own.size] for own in force.T], axis=1)

    true = Sources(np.array([0.002]), np.array([[0.0, 1.0]]), corners)
    force = true.forces(20_000, dt, 1, rng)[:, 0]
    left = shown(force) + true.noise(20_000, 1, rng)[:, :, 0]
    white = rng.standard_normal((20_000, 4))
    found = likeliest_sources(
        [left], [[(white, white[:, None])]], [[(white, shown(white)[:, None])]], [dt], corners
    )
    assert found.noise_std == pytest.approx(true.noise_std, rel=0.1)
    assert found.force_std[0, 1] == pytest.approx(1.0, rel=0.2)
    assert found.force_std[0, 0] < 0.3


def test_a_force_that_no_sensor_shows_leaves_the_others_as_they_are() -> None:
    rng, dt, corners = np.random.default_rng(5), 0.01, np.array([np.inf])
    white = rng.standard_normal((2000, 4))
    left = 2.0 * white[:, :1] + 0.1 * rng.standard_normal((2000, 1))
    own = rng.standard_normal((2000, 4))
    noise = [[(own, own[:, None])]]
    shown = [[(white, white[:, None])], [(np.ones((2000, 1)), np.zeros((2000, 1, 1)))]]
    alone, beside = (likeliest_sources([left], noise, forces, [dt], corners) for forces in (shown[:1], shown))
    np.testing.assert_allclose(beside.noise_std, alone.noise_std)
    np.testing.assert_allclose(beside.force_std, [*alone.force_std, [0.0]])


def test_colored_forces_have_variance_one_from_the_first_sample() -> None:
    drawn = colored((400, 3000), 0.05, np.random.default_rng(0))
    assert np.var(drawn[0]) == pytest.approx(1.0, rel=0.1)
    assert np.var(drawn[-1]) == pytest.approx(1.0, rel=0.1)
    lag = np.mean(drawn[100] * drawn[120])
    assert lag == pytest.approx(np.exp(-0.05 * 20), abs=0.08)
