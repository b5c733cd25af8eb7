"""A second effect that follows a force from outside explains nothing; one that is there does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.noise.evidence import Evidence
from rigsight.diagnose.search.evidence_for_more import beyond_disturbance
from rigsight.diagnose.search.single_effects import fit_candidate, reidentify
from rigsight.effects import effect_named
from rigsight.identify import characteristic_scales
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT, N, NOISE = 0.01, 2000, 1e-5
VALUES = {"gain": 1.0, "m": 1.0, "d": 0.2, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
CUBIC, TONE, FRICTION, LAG = (
    effect_named(name)
    for name in ("cubic_stiffness", "periodic_disturbance", "coulomb_friction", "actuator_lag")
)


def bench_of(own: Mapping[str, float], force: float, seed: int = 2) -> FitContext:
    """Four runs of many tones; a white force from outside swings the mass, and nobody records it."""
    rng, t = np.random.default_rng(seed), DT * np.arange(N)
    effects = [effect for effect in (CUBIC, FRICTION, LAG) if effect.parameters[0].name in own]
    structure, records = compose(AXIS, effects), []
    for number in range(4):
        u = sum(0.3 * np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.0)) for f in np.arange(0.4, 4.0, 0.3))
        asked = Record(f"run {number}", DT, {"u": np.asarray(u)}, {}, hold="zoh")
        pushed = asked.with_signals(u=u + rng.normal(scale=force, size=N))
        x = simulate(structure, {**VALUES, **own}, pushed)["x"]
        records.append(asked.with_signals(x=x + rng.normal(scale=NOISE, size=N)))
    fitted, scored = tuple(records[:2]), tuple(records[2:])
    scales = characteristic_scales(AXIS, fitted, VALUES)
    return FitContext(AXIS, fitted, scored, fitted, scales, {"x": NOISE}, frozenset(), VALUES)


def modelled(context: FitContext) -> tuple[FittedModel, FittedModel, FittedModel, FittedModel]:
    """The equations, a spring that hardens, a tone beside it and friction beside it."""
    reidentified = reidentify(context, VALUES)
    single = fit_candidate(context, (CUBIC,), reidentified.fit)
    return (
        reidentified,
        single,
        *(fit_candidate(context, (CUBIC, second), single.fit) for second in (TONE, FRICTION)),
    )


@pytest.mark.slow
def test_a_tone_that_follows_the_swing_of_a_disturbed_mass_explains_nothing() -> None:
    """The evidence is a probability: by chance a tone passes in one of ten draws, before and after bounds on its start."""
    passing = []
    for seed in range(1, 11):
        context = bench_of({"k_3": 2e3}, 0.01, seed)
        reidentified, single, tone, _ = modelled(context)
        assert single.error_over_noise > 3.0
        if beyond_disturbance(Evidence(context, reidentified, single), [single], [single], [tone]):
            passing.append(seed)
    assert len(passing) <= 1


@pytest.mark.slow
@pytest.mark.parametrize("force", [0.0, 0.01])
def test_a_second_effect_that_is_there_stands_with_and_without_a_disturbance(force: float) -> None:
    context = bench_of({"k_3": 2e3, "T_c": 0.02}, force)
    reidentified, single, tone, friction = modelled(context)
    evidence = Evidence(context, reidentified, single)
    assert beyond_disturbance(evidence, [single], [single], [tone, friction])[-1] is friction
    assert evidence.criterion(friction) < min(evidence.criterion(single), evidence.criterion(tone)) - 100.0


@pytest.mark.slow
def test_the_powers_of_force_and_noise_are_told_apart() -> None:
    context = bench_of({"k_3": 2e3}, force=0.01)
    reidentified, single, *_ = modelled(context)
    ((noise, force),) = Evidence(context, reidentified, single).powers
    # Lines are scaled so that white noise has its variance; a tenth of a record is faded.
    assert np.sqrt(noise) == pytest.approx(NOISE, rel=0.1)
    assert np.sqrt(force) == pytest.approx(0.01, rel=0.15)


@pytest.mark.slow
def test_what_trades_a_slow_error_for_a_fast_one_gains_nothing() -> None:
    context = bench_of({"k_3": 2e3, "T_c": 0.02}, 0.01)
    reidentified, single, _, friction = modelled(context)
    evidence, rng = Evidence(context, reidentified, single), np.random.default_rng(0)

    def shaken(parts: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
        return tuple(0.5 * left + rng.normal(scale=3.0 * NOISE, size=left.shape) for left in parts)

    traded = replace(
        friction,
        fit=replace(friction.fit, residuals=shaken(single.fit.residuals)),
        held_out=replace(friction.held_out, residuals=shaken(single.held_out.residuals)),
    )
    assert evidence.gain(friction, single) > 0.0 > evidence.gain(traded, single)
    assert beyond_disturbance(evidence, [single], [single], [traded]) == []


@pytest.mark.parametrize(
    "changes", [{"observed": {"x": 3.0}}, {"free_offsets": ("x",)}], ids=["observer", "offsets"]
)
def test_evidence_is_known_under_observers_and_free_offsets(changes: dict[str, Any]) -> None:
    context = bench_of({"k_3": 2e3}, 0.01)
    fitted, scored = (
        tuple(replace(r, **changes) for r in part) for part in (context.estimation, context.scoring)
    )
    context = replace(context, estimation=fitted, scoring=scored, look=fitted)
    reidentified = reidentify(context, VALUES)
    single = fit_candidate(context, (CUBIC,), reidentified.fit)
    evidence = Evidence(context, reidentified, single)
    assert evidence.criterion(single) < evidence.criterion(reidentified) - 100.0


def test_states_that_move_the_readings_alike_cost_as_much() -> None:
    """Between a linear mass and its only sensor a lag of the drive is one of the sensor."""
    context = bench_of({"T_a": 0.03}, 0.01)
    reidentified = reidentify(context, VALUES)
    late = [
        fit_candidate(context, (effect,), reidentified.fit) for effect in (LAG, effect_named("sensor_lag"))
    ]
    evidence = Evidence(context, reidentified, reidentified)
    drive, sensor = (evidence.criterion(model) for model in late)
    assert drive == pytest.approx(sensor, abs=1.0)
