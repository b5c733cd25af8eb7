"""A spring that is nearly all memory is identified to a few percent from wherever its fit starts."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.result import Diagnosis
from rigsight.diagnose.search.starts import restart_values
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.records.record import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

from ...tiers import slow_but

DT = 0.01
NOISE = 2e-5
IWAN = effect_named("iwan_hysteresis")
STRUCTURE = compose(AXIS, [IWAN])
RIG = {"gain": 1.0, "m": 1.0, "d": 1.6, "x_off": 0.0, "force_off": 0.0}


@pytest.fixture
def fit_at():
    """Return a stand-in for a fit that ended at given values."""
    return lambda values: SimpleNamespace(values=values, structure=STRUCTURE)


NEARLY_ALL_MEMORY = {**RIG, "k": 2500.0, "a": 0.03, "x_s": 0.002, "q": -0.4}
TRUTHS = {
    "nearly all memory": NEARLY_ALL_MEMORY,
    "sliders of any size": {**RIG, "k": 180.0, "a": 0.55, "x_s": 0.008, "q": -0.7},
    "large sliders": {**RIG, "k": 150.0, "a": 0.75, "x_s": 0.006, "q": 0.5},
}


def recorded(truth: Mapping[str, float], draw: int = 0, disturbance: int = 0) -> Campaign:
    """Records with a draw of noise, and on request disturbed by 1e-9 of it."""
    noise, rounding = np.random.default_rng(draw), np.random.default_rng([draw, disturbance])
    t = DT * np.arange(2000)
    records = []
    for name, role, size in (
        ("low", "estimation", 0.3),
        ("high", "estimation", 1.0),
        ("middle", "validation", 0.6),
    ):
        run = Record(name, DT, {"u": linear_sweep(t, size, 1.0, 30.0)}, {}, role=role, hold="zoh")
        clean = simulate(STRUCTURE, truth, run)
        x = clean["x"] + noise.normal(scale=NOISE, size=t.size)
        if disturbance:
            x = x + rounding.normal(scale=1e-9 * NOISE, size=t.size)
        records.append(clean.with_signals(x=x))
    return Campaign("memory", AXIS, {"gain": 1.0}, {}, tuple(records))


@cache
def diagnosed(name: str) -> Diagnosis:
    """Return the diagnosis of undisturbed records, made once for the tests that look at it."""
    return diagnose(recorded(TRUTHS[name]), [IWAN])


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but("nearly all memory", of=TRUTHS))
def test_its_numbers_come_back(name: str) -> None:
    truth, found = TRUTHS[name], diagnosed(name)
    assert found.effects == ("iwan_hysteresis",)
    best = found.candidates[0]
    assert best.error_over_noise < 1.1
    for number in ("k", "a", "x_s", "q"):
        assert best.parameters[number].value == pytest.approx(truth[number], rel=0.02), number


@pytest.mark.slow
@pytest.mark.parametrize("draw", [4, 5, 6])
def test_no_draw_of_noise_leads_to_a_wrong_minimum(draw: int) -> None:
    """Another one, with sliders that reach sixty times as far, leaves eight times the noise."""
    best = diagnose(recorded(NEARLY_ALL_MEMORY, draw, disturbance=1), [IWAN]).candidates[0]
    assert best.error_over_noise < 1.1
    for name in ("k", "a", "x_s", "q"):
        assert best.parameters[name].value == pytest.approx(NEARLY_ALL_MEMORY[name], rel=0.02), name


@pytest.mark.slow
@pytest.mark.parametrize("case", ["nearly all memory", "sliders of any size"])
def test_rounding_moves_no_number(case: str) -> None:
    """A disturbance of 1e-9 of the noise stands for another processor; no number moves by a hundredth of its standard error."""
    found = diagnose(recorded(TRUTHS[case], disturbance=1), [IWAN]).candidates[0].parameters
    for name, estimate in diagnosed(case).candidates[0].parameters.items():
        assert abs(found[name].value - estimate.value) < 0.01 * estimate.std, name


def test_a_fit_that_took_the_sliders_for_their_neighbors_is_moved(fit_at) -> None:
    """Reaches differ by a factor of 10^(2.7 / 6) from slider to slider."""
    values = {**RIG, "k": 100.0, "a": 0.5, "x_s": 0.01, "q": -0.4}
    moved = list(restart_values(STRUCTURE, IWAN, fit_at(values)))
    steps = [np.log10(m["x_s"] / 0.01) * 6 / 2.7 for m in moved]
    np.testing.assert_allclose(steps, [-3.0, -2.0, -1.0, -0.5, -0.2, 0.2, 0.5, 1.0], atol=1e-9)
    for start in moved:
        assert {n: v for n, v in start.items() if n != "x_s"} == {
            n: v for n, v in values.items() if n != "x_s"
        }


def test_most_effects_know_no_place_to_try_again(fit_at) -> None:
    cubic = effect_named("cubic_stiffness")
    assert list(restart_values(compose(AXIS, [cubic]), cubic, fit_at({**RIG, "k": 100.0, "k_3": 1.0}))) == []
