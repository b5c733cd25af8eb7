"""A pair of which no single effect shows the way is found from the declared starts of both."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.search.several.joint_starts import with_joint_starts
from rigsight.diagnose.search.single_effects import fit_candidate, fit_candidates, reidentify
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 1.0, "d": 3.0, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
HIDDEN = {"input_saturation": {"u_max": 0.5}, "iwan_hysteresis": {"a": 0.3, "x_s": 0.003, "q": 0.0}}
DT, NOISE = 0.01, 2e-5


@pytest.fixture(scope="module")
def context() -> FitContext:
    rng, t = np.random.default_rng(0), DT * np.arange(1500)
    structure = compose(AXIS, [effect_named(name) for name in HIDDEN])
    truth = {**VALUES, **{name: value for own in HIDDEN.values() for name, value in own.items()}}
    records = []
    for name, size, role in (("a", 0.5, "estimation"), ("b", 1.0, "estimation"), ("c", 0.8, "validation")):
        driven = Record(name, DT, {"u": linear_sweep(t, size, 0.5, 20.0)}, {}, role=role, hold="zoh")
        clean = simulate(structure, truth, driven)
        records.append(clean.with_signals(x=clean["x"] + rng.normal(scale=NOISE, size=t.size)))
    fitted, held_out = tuple(records[:2]), tuple(records[2:])
    scales = characteristic_scales(AXIS, fitted, VALUES)
    return FitContext(AXIS, fitted, held_out, fitted, scales, {"x": NOISE}, frozenset({"force_off"}), VALUES)


@pytest.fixture(scope="module")
def grown(context: FitContext) -> tuple[FittedModel, list[FittedModel], FittedModel]:
    """The equations without an effect, single effects, and a pair in which a relative stands for the hysteresis."""
    reidentified = reidentify(context, VALUES)
    saturation, relative = effect_named("input_saturation"), effect_named("presliding_friction")
    effects = [saturation, relative, effect_named("iwan_hysteresis")]
    singles = fit_candidates(context, reidentified, effects)
    alone = next(model for model in singles if model.names == ("input_saturation",))
    return reidentified, singles, fit_candidate(context, (saturation, relative), alone.fit)


@pytest.mark.slow
def test_a_relative_gives_way_to_the_right_effect(context: FitContext, grown) -> None:
    reidentified, singles, pair = grown
    effects = [effect_named(name) for name in ("input_saturation", "presliding_friction", "iwan_hysteresis")]
    assert pair.error_over_noise > 1.1
    best = min(
        with_joint_starts(context, reidentified, [pair], singles, effects, lambda _: False),
        key=lambda model: model.error_over_noise,
    )
    assert set(best.names) == {"input_saturation", "iwan_hysteresis"}
    assert best.error_over_noise < 1.05
    assert best.fit.values["u_max"] == pytest.approx(HIDDEN["input_saturation"]["u_max"], rel=1e-2)


@pytest.mark.slow
def test_nothing_else_is_looked_for_where_noise_is_all_that_is_left(context: FitContext, grown) -> None:
    reidentified, singles, pair = grown
    assert with_joint_starts(context, reidentified, [pair], singles, [], lambda _: True) == [pair]
