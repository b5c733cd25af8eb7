"""What is known of parameters beside the records moves a fit as far as it counts, and no further."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.identify import FitResult, GreyBoxFit, characteristic_scales
from rigsight.identify.fit.fit_data import Prior
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
FREE, NOISE = ("m", "k"), 1e-4


def problem(known: Prior | None) -> GreyBoxFit:
    structure = compose(AXIS)
    push = Record("push", 0.01, {"u": np.sin(np.linspace(0.0, 60.0, 400) ** 1.3)}, {})
    record = simulate(structure, VALUES, push)
    record = record.with_signals(x=record["x"] + NOISE * np.random.default_rng(0).standard_normal(400))
    scales = characteristic_scales(AXIS, [record], VALUES)
    return GreyBoxFit(structure, [record], scales, {"x": NOISE}, prior=known)


def fitted(known: Prior | None) -> FitResult:
    return problem(known).fit({**VALUES, "m": 2.2, "k": 820.0}, FREE)


def prior(m: float, k: float, weight: float) -> Prior:
    return Prior(FREE, np.array([m, k]), weight * np.diag([1.0 / m**2, 1.0 / k**2]))


def test_one_that_hardly_counts_moves_nothing() -> None:
    free, held = fitted(None), fitted(prior(4.0, 1600.0, 1e-12))
    for name in FREE:
        assert held.values[name] == pytest.approx(free.values[name], abs=1e-3 * free.standard_errors[name])


def test_one_that_counts_more_than_the_records_decides() -> None:
    held = fitted(prior(2.5, 900.0, 1e9))
    assert held.values["m"] == pytest.approx(2.5, rel=1e-3)
    assert held.values["k"] == pytest.approx(900.0, rel=1e-3)


def test_the_fit_is_where_the_sum_of_both_costs_is_least() -> None:
    known = prior(2.05, 815.0, 10.0)
    held = fitted(known)

    def cost(values: dict[str, float]) -> float:
        away = np.array([values[name] for name in FREE]) - known.values
        records = problem(None)
        return records.fit(values, []).cost + records.n_samples * float(away @ known.curvature @ away)

    least = cost(held.values)
    for name in FREE:
        for factor in (0.999, 1.001):
            assert cost({**held.values, name: factor * held.values[name]}) > least


def test_the_cost_and_the_errors_are_those_of_the_records() -> None:
    free, held = fitted(None), fitted(prior(2.0, 800.0, 1e-3))
    assert held.cost == pytest.approx(held.n_samples * held.weighted_rms**2)
    assert held.cost >= free.cost * (1.0 - 1e-6)
    assert held.standard_errors["m"] == pytest.approx(free.standard_errors["m"], rel=0.05)
