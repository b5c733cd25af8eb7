"""Loop areas against the closed form, saturation and its interval."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from rigsight.effects import effect_named
from rigsight.effects.symbols import deflection_rate
from rigsight.errors import InputError
from rigsight.identify import FitResult
from rigsight.identify.hysteresis import derived_quantities, loop_area
from rigsight.identify.hysteresis.derived import saturation_level
from rigsight.rigs import AXIS, RUNNING_GEAR, rig_file_text
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, parameter_vector

BOUC_WEN = effect_named("bouc_wen_hysteresis")
VALUES = {
    "gain": 1.0,
    "m": 1.0,
    "d": 3.0,
    "k": 500.0,
    "A": 1.0,
    "a": 0.3,
    "beta": 40.0,
    "gamma": 10.0,
    "n": 1.0,
}
SCALES = {"x": 0.05, "input": 1.0, "drive": 1.0, "force": 25.0, "time": 0.05, "length": 1.0}


def closed_form(values: dict[str, float], amplitude: float) -> float:
    """Energy per cycle for n = 1: on loading z' = 1 - s z above zero and 1 - q z below, s, q = beta +- gamma."""
    s, q = values["beta"] + values["gamma"], values["beta"] - values["gamma"]

    def stroke(top: float) -> float:
        return math.log1p(q * top) / q - math.log1p(-s * top) / s

    top = brentq(lambda z: stroke(z) - 2.0 * amplitude, 0.0, (1.0 - 1e-15) / s, xtol=1e-16)
    below = -top / q + math.log1p(q * top) / q**2
    above = -top / s - math.log1p(-s * top) / s**2
    return 2.0 * (1.0 - values["a"]) * values["k"] * (above + below)


def fit_of(values: dict[str, float], free: tuple[str, ...], covariance: np.ndarray) -> FitResult:
    structure = compose(AXIS, [BOUC_WEN])
    complete = dict(zip(structure.names, parameter_vector(structure, values), strict=True))
    errors = dict(zip(free, np.sqrt(np.diag(covariance)), strict=True))
    return FitResult(structure, True, "", complete, errors, (), 1.0, 1, 1, free, covariance, ())


@pytest.mark.parametrize("amplitude", [0.002, 0.02, 0.2])
@pytest.mark.parametrize(("beta", "gamma"), [(40.0, 10.0), (40.0, -30.0), (25.0, 24.0)])
def test_the_loop_area_is_that_of_the_closed_form(amplitude: float, beta: float, gamma: float) -> None:
    values = {**VALUES, "beta": beta, "gamma": gamma}
    structure = compose(AXIS, [BOUC_WEN])
    found = loop_area(structure, parameter_vector(structure, values)[:, None], amplitude)
    assert found[0] == pytest.approx(closed_form(values, amplitude), rel=2e-3)


def test_damping_and_an_exponent_written_as_a_number_do_not_change_the_loop() -> None:
    whole, special = compose(AXIS, [BOUC_WEN]), compose(AXIS, [BOUC_WEN], {"n": 1.0})
    areas = [
        loop_area(structure, parameter_vector(structure, {**VALUES, "d": d})[:, None], 0.03)[0]
        for structure, d in ((whole, 0.0), (whole, 50.0), (special, 50.0))
    ]
    assert areas[1:] == pytest.approx([areas[0]] * 2, rel=1e-12)


def test_a_spring_without_hysteresis_has_no_loop() -> None:
    structure = compose(AXIS, [effect_named("cubic_stiffness")])
    with pytest.raises(InputError, match="there is no loop"):
        loop_area(structure, np.ones((len(structure.names), 1)), 0.1)
    whole = compose(AXIS, [BOUC_WEN])
    with pytest.raises(InputError, match="must be positive"):
        loop_area(whole, parameter_vector(whole, VALUES)[:, None], 0.0)


@pytest.mark.slow
def test_the_interval_of_the_saturation_follows_the_sum_not_the_parts() -> None:
    # beta and gamma are known to 20 % each, and so anticorrelated that their sum is known to 2 %.
    covariance = np.array([[64.0, -63.5], [-63.5, 64.0]])
    found = derived_quantities(
        fit_of(VALUES, ("beta", "gamma"), covariance), [0.05], SCALES, np.random.default_rng(0)
    )
    assert found.saturation is not None
    assert found.saturation.value == pytest.approx(1.0 / 50.0)
    assert found.saturation.lower == pytest.approx(1.0 / 52.0, rel=0.01)
    assert found.saturation.upper == pytest.approx(1.0 / 48.0, rel=0.01)
    total, difference = found.pairs
    assert (total.value, difference.value) == pytest.approx((50.0, 30.0))
    assert difference.upper - difference.lower == pytest.approx(2 * 1.96 * math.sqrt(255.0), rel=0.15)
    (area,) = found.loop_areas
    assert area.energy.lower < area.energy.value < area.energy.upper
    assert area.energy.unit == "J"


def test_a_sum_that_may_be_zero_has_no_upper_bound_and_says_so() -> None:
    covariance = np.diag([64.0, 64.0])
    uncertain = derived_quantities(
        fit_of({**VALUES, "beta": 20.0, "gamma": -10.0}, ("beta", "gamma"), covariance),
        [],
        SCALES,
        np.random.default_rng(0),
    )
    assert uncertain.saturation is not None
    assert uncertain.saturation.upper == math.inf
    assert "or never" in uncertain.saturation_in_words
    unbounded = derived_quantities(
        fit_of({**VALUES, "beta": 10.0, "gamma": -12.0}, (), np.zeros((0, 0))),
        [],
        SCALES,
        np.random.default_rng(0),
    )
    assert unbounded.saturation is not None
    assert unbounded.saturation.value == math.inf
    assert "never saturates" in unbounded.saturation_in_words


def test_undetermined_parameters_leave_everything_open() -> None:
    found = derived_quantities(
        fit_of(VALUES, ("beta", "gamma"), np.diag([np.inf, 1.0])), [0.05], SCALES, np.random.default_rng(0)
    )
    assert all(math.isinf(pair.upper) and math.isinf(pair.lower) for pair in found.pairs)


def test_the_scale_of_z_is_part_of_the_saturation() -> None:
    fit = fit_of({**VALUES, "A": 4.0, "n": 2.0}, (), np.zeros((0, 0)))
    found = derived_quantities(fit, [], SCALES, np.random.default_rng(0))
    assert found.saturation is not None
    assert found.saturation.value == pytest.approx(math.sqrt(4.0 / 50.0))


def test_the_saturation_follows_from_whatever_rate_is_declared() -> None:
    (z,) = BOUC_WEN.states
    beta, gamma = sp.symbols("beta gamma", real=True)
    other = replace(
        BOUC_WEN, states=(replace(z, rate=deflection_rate * (3 - beta * z.symbol**2 - gamma * z.symbol**2)),)
    )
    level = saturation_level(other)
    assert level is not None
    assert float(level.subs({beta: 10.0, gamma: 2.0})) == pytest.approx(0.5)
    assert saturation_level(replace(BOUC_WEN, states=(replace(z, rate=deflection_rate),))) is None


def test_a_spring_may_state_its_stiffness_by_any_expression() -> None:
    text = rig_file_text("axis").replace('stiffness = "k"', 'stiffness = "2*k"')
    two = compose(rig_of_text(text.replace('name = "axis"', 'name = "stage"')), [BOUC_WEN])
    one = compose(AXIS, [BOUC_WEN])
    each = {**VALUES, "k": 0.5 * VALUES["k"]}
    assert loop_area(two, parameter_vector(two, each)[:, None], 0.02) == pytest.approx(
        loop_area(one, parameter_vector(one, VALUES)[:, None], 0.02)
    )


def test_iwan_hysteresis_has_a_loop_but_no_pair() -> None:
    structure = compose(RUNNING_GEAR, [effect_named("iwan_hysteresis")])
    values = {
        "v": 1.0,
        "r_0": 0.1,
        "b": 0.3,
        "k_tau": 0.27,
        "J_z": 0.4,
        "k_c": 2318.0,
        "k_d": 0.1,
        "l_0": 0.25,
        "c_y": 0.98,
    }
    values |= {"a": 0.02, "x_s": 0.0045, "q": -0.45}
    area = loop_area(structure, parameter_vector(structure, values)[:, None], 0.05)[0]
    # Beyond slip the loop is a parallelogram: four times the sliding force times the slid way, at most 4 F X.
    sliding = 0.98 * 2318.0 * 0.0045
    assert 0.0 < area < 4.0 * sliding * 0.05


def test_an_exponent_at_its_bound_leaves_the_fitted_value_inside_the_interval() -> None:
    # n cannot fall below 1, where it was fitted; sum and difference S, D grow with it by S log(S), D log(D).
    total, difference = 50.0 * math.log(50.0), 30.0 * math.log(30.0)
    slopes = np.array([0.5 * (total + difference), 0.5 * (total - difference), 1.0])
    covariance = 0.01**2 * np.outer(slopes, slopes) + np.diag([0.25, 0.25, 0.0])
    fit = fit_of(VALUES, ("beta", "gamma", "n"), covariance)
    found = derived_quantities(fit, [], SCALES, np.random.default_rng(0)).pairs[0]
    # Half of the draws end at the bound, where the sum varies by the root of 0.5; the others raise it.
    assert found.lower == pytest.approx(50.0 - 1.645 * math.sqrt(0.5), abs=0.4)
    assert found.upper == pytest.approx(50.0 + 1.96 * math.hypot(0.01 * total, math.sqrt(0.5)), abs=0.5)
