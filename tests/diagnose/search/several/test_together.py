"""Three effects are found from the equations without any of them, without the fit of a single one."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.diagnose.search.together import Together
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import characteristic_scales
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
HIDDEN = {"k_3": 2e4, "T_c": 0.02, "T_a": 0.003}
EFFECTS = ("cubic_stiffness", "coulomb_friction", "actuator_lag")
OTHERS = ("quadratic_damping", "position_dependent_damping", "input_saturation", "input_dead_zone")
NOISE = 2e-5


def measured(role: str, amplitude: float, rng: np.random.Generator) -> Record:
    t = 0.01 * np.arange(2000)
    record = Record(role, 0.01, {"u": linear_sweep(t, amplitude, 1.0, 30.0)}, {}, role=role, hold="zoh")
    clean = simulate(compose(AXIS, [effect_named(name) for name in EFFECTS]), VALUES | HIDDEN, record)
    return clean.with_signals(x=clean["x"] + rng.normal(scale=NOISE, size=t.size))


@pytest.mark.slow
def test_three_effects_are_fitted_from_where_the_screening_puts_them() -> None:
    rng = np.random.default_rng(0)
    fitted = (measured("estimation", 0.4, rng), measured("estimation", 1.0, rng))
    scored = (measured("validation", 0.7, rng),)
    scales = characteristic_scales(AXIS, fitted, VALUES)
    held = frozenset({"force_off"})
    context = FitContext(AXIS, fitted, scored, fitted, scales, {"x": NOISE}, held)
    candidates = [effect_named(name) for name in (*OTHERS, *EFFECTS, "periodic_disturbance")]
    together = Together(context, reidentify(context, VALUES), candidates)
    best = min(together.fitted(3), key=lambda model: model.error_over_noise)
    assert set(best.names) == set(EFFECTS)
    assert best.error_over_noise < 1.05
    for name, true in HIDDEN.items():
        assert best.fit.values[name] == pytest.approx(true, rel=0.02)
    assert all(len(model.effects) == 2 for model in together.fitted(2))
