"""A triple competes with its own parts as well as they can be fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.search.several.third_effect import with_relatives
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import characteristic_scales
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 1.0, "d": 3.0, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
HIDDEN = {"u_max": 0.5, "k_2": 500.0}
PAIR = ("input_saturation", "asymmetric_stiffness")
DT, NOISE = 0.01, 2e-5


def measured(role: str, amplitude: float, rng: np.random.Generator) -> Record:
    t = DT * np.arange(1500)
    record = Record(role, DT, {"u": linear_sweep(t, amplitude, 0.5, 20.0)}, {}, role=role, hold="zoh")
    clean = simulate(compose(AXIS, [effect_named(name) for name in PAIR]), VALUES | HIDDEN, record)
    return clean.with_signals(x=clean["x"] + rng.normal(scale=NOISE, size=t.size))


@pytest.mark.slow
def test_a_pair_that_stopped_short_is_found_again_from_a_triple() -> None:
    rng = np.random.default_rng(0)
    fitted = (measured("estimation", 0.6, rng), measured("estimation", 1.0, rng))
    scored = (measured("validation", 0.8, rng),)
    scales = characteristic_scales(AXIS, fitted, VALUES)
    context = FitContext(AXIS, fitted, scored, fitted, scales, {"x": NOISE}, frozenset({"force_off"}))

    def model(names: tuple[str, ...], own: dict[str, float]) -> FittedModel:
        effects = tuple(effect_named(name) for name in names)
        structure = context.composed(effects)
        fit = context.problem(structure, fitted).fit({**VALUES, **own}, [])
        return context.score(effects, replace(fit, free=tuple(context.free_parameters(structure))))

    stopped = model(PAIR, {"u_max": 2.0, "k_2": 500.0})
    triple = model((*PAIR, "cubic_stiffness"), {**HIDDEN, "k_3": 10.0})
    singles = [model((name,), HIDDEN | {"k_3": 10.0}) for name in triple.names]
    assert stopped.error_over_noise > 3.0 * triple.error_over_noise
    triples, pairs = with_relatives(context, [triple], [stopped], singles, effects=[])
    assert triples == [triple]
    again = next(pair for pair in pairs if set(pair.names) == set(PAIR))
    assert again.error_over_noise == pytest.approx(1.0, abs=0.1)
    assert again.fit.values["u_max"] == pytest.approx(0.5, rel=0.01)
    assert len(pairs) == 3, "each part of the triple once"
