"""Which effects are tried beside a model: those that the screening suggests, and the others where these do not suffice."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.one_more_effect import with_one_more
from rigsight.diagnose.search.single_effects import fit_candidates, reidentify
from rigsight.diagnose.search.worth_fitting import search_places
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import characteristic_scales
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
HIDDEN = {"c_2": 5.0, "m_a": 0.1, "w_a": 7.0, "zeta_a": 0.02}
"""A mass on a spring, with a natural frequency far below the starts that its effect declares."""
NOISE = 2e-5


RIPPLE = {"c_2": 5.0, "T_sin": 0.1, "T_cos": 0.05, "kappa": 150.0}


def measured(
    effect: str, role: str, amplitude: float, rng: np.random.Generator, noise: float = NOISE
) -> Record:
    effects = [effect_named("quadratic_damping"), effect_named(effect)]
    t = 0.01 * np.arange(2000)
    record = Record(role, 0.01, {"u": linear_sweep(t, amplitude, 1.0, 30.0)}, {}, role=role, hold="zoh")
    clean = simulate(compose(AXIS, effects), {**VALUES, **HIDDEN, **RIPPLE}, record)
    return clean.with_signals(x=clean["x"] + rng.normal(scale=noise, size=t.size))


def beside_a_damping(effect: str, noise: float = NOISE) -> tuple[FitContext, FittedModel]:
    """Return the records of a quadratic damping with an effect, and the damping fitted alone."""
    rng = np.random.default_rng(0)
    fitted = tuple(measured(effect, "estimation", amplitude, rng, noise) for amplitude in (0.4, 1.0))
    scored = (measured(effect, "validation", 0.7, rng, noise),)
    scales = characteristic_scales(AXIS, fitted, VALUES)
    context = FitContext(AXIS, fitted, scored, fitted, scales, {"x": noise}, frozenset())
    (damped,) = fit_candidates(context, reidentify(context, VALUES), [effect_named("quadratic_damping")])
    return context, damped


@pytest.mark.slow
def test_an_effect_that_the_screening_puts_last_is_tried_where_the_first_ones_explain_too_little() -> None:
    context, damped = beside_a_damping("flexible_mode")
    tried = [effect_named("maxwell_branch"), effect_named("flexible_mode")]
    assert [effect.name for effect in search_places(context, damped, tried).effects] == ["maxwell_branch"]

    suggested = with_one_more(context, damped, tried, [damped])
    assert all(model.names[-1] == "maxwell_branch" for model in suggested)
    everything = with_one_more(context, damped, tried, [damped], enough=VERDICT.at_floor)
    best = min(everything, key=lambda model: model.error_over_noise)
    assert best.names == ("quadratic_damping", "flexible_mode")
    assert best.error_over_noise < VERDICT.at_floor


@pytest.mark.slow
def test_an_effect_that_no_push_represents_is_tried_where_the_pushes_explain_too_little() -> None:
    context, damped = beside_a_damping("torque_ripple")
    tried = [effect_named("maxwell_branch"), effect_named("torque_ripple")]
    (found,) = with_one_more(context, damped, tried, [damped], least_share=0.99)
    assert found.names == ("quadratic_damping", "torque_ripple")
    assert found.error_over_noise < VERDICT.at_floor


@pytest.mark.slow
def test_beside_a_model_near_the_floor_an_effect_is_tried_that_explains_all_but_noise() -> None:
    _, damped = beside_a_damping("torque_ripple")
    ripple = NOISE * np.sqrt(damped.error_over_noise**2 - 1.0)
    context, damped = beside_a_damping("torque_ripple", noise=ripple / np.sqrt(1.03**2 - 1.0))
    assert damped.error_over_noise < VERDICT.at_floor
    (found,) = with_one_more(context, damped, [effect_named("torque_ripple")], [damped])
    assert found.error_over_noise < VERDICT.exact
    assert found.fit.cost > SEARCH.worth_following * damped.fit.cost, "noise is most of both costs"
