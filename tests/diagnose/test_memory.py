"""A spring that is nearly all memory is identified to a few percent from wherever its fit starts."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rigsight.diagnose import Task, diagnose
from rigsight.diagnose.starts import restart_values
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.records.record import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT = 0.01
NOISE = 2e-5
IWAN = effect_named("iwan_hysteresis")
STRUCTURE = compose(AXIS, [IWAN])
RIG = {"gain": 1.0, "m": 1.0, "d": 1.6, "x_off": 0.0, "force_off": 0.0}


@pytest.fixture
def fit_at():
    """Return a stand-in for a fit that ended at given values."""
    return lambda values: SimpleNamespace(values=values, structure=STRUCTURE)


@pytest.mark.parametrize(
    ("k", "a", "x_s", "q"),
    [(2500.0, 0.03, 0.002, -0.4), (180.0, 0.55, 0.008, -0.7), (150.0, 0.75, 0.006, 0.5)],
    ids=["nearly all memory", "sliders of any size", "large sliders"],
)
def test_its_numbers_come_back(k: float, a: float, x_s: float, q: float) -> None:
    truth = {**RIG, "k": k, "a": a, "x_s": x_s, "q": q}
    rng = np.random.default_rng(0)
    t = DT * np.arange(2000)
    records = []
    for name, role, size in (
        ("low", "estimation", 0.3),
        ("high", "estimation", 1.0),
        ("middle", "validation", 0.6),
    ):
        run = Record(name, DT, {"u": linear_sweep(t, size, 1.0, 30.0)}, {}, role=role, hold="zoh")
        clean = simulate(STRUCTURE, truth, run)
        records.append(clean.with_signals(x=clean["x"] + rng.normal(scale=NOISE, size=t.size)))
    found = diagnose(Task("memory", AXIS, {"gain": 1.0}, {}, tuple(records)), [IWAN])
    assert found.effects == ("iwan_hysteresis",)
    best = found.candidates[0]
    assert best.excess < 1.1
    for name in ("k", "a", "x_s", "q"):
        assert best.parameters[name].value == pytest.approx(truth[name], rel=0.02), name


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
