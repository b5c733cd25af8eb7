"""With an initial state of its own at each step, a window of a motion with play leads to the play."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.identify.fit.coordinates import Coordinates
from rigsight.identify.fit.first_states import first_state
from rigsight.identify.fit.search import VariableProjection
from rigsight.identify.fit.windows import Windowing
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT, NOISE = 5e-3, 1e-5
PLAY = compose(AXIS, [effect_named("backlash")])
TRUTH = {"gain": 1.0, "m": 3.0, "d": 9.0, "k": 540.0, "x_off": 0.0, "force_off": 0.0, "g": 1.4e-4}
FREE = ("m", "d", "k", "x_off", "g")


@pytest.fixture(scope="module")
def windows() -> tuple[Record, ...]:
    rng = np.random.default_rng(3)
    t = DT * np.arange(4000)
    run = Record("sweep", DT, {"u": linear_sweep(t, 0.5, 3.0, 40.0)}, {}, role="estimation", hold="zoh")
    clean = simulate(PLAY, TRUTH, run)
    record = clean.with_signals(x=clean["x"] + rng.normal(scale=NOISE, size=t.size))
    return Windowing(cycles=4, noise={"x": NOISE}).cut([record])


def problem_of(windows: tuple[Record, ...]) -> GreyBoxFit:
    return GreyBoxFit(PLAY, windows, characteristic_scales(AXIS, windows, TRUTH), {"x": NOISE})


@pytest.mark.parametrize("wrong", [0.4, 2.0])
def test_a_play_far_from_its_start_is_found_to_the_noise(windows: tuple[Record, ...], wrong: float) -> None:
    start = {**TRUTH, "g": wrong * TRUTH["g"], "d": 8.0, "k": 530.0, "m": 3.1}
    found = problem_of(windows).fit_windows(start, FREE)
    assert found.weighted_rms == pytest.approx(1.0, abs=0.05)
    for name in ("m", "d", "k", "g"):
        assert found.values[name] == pytest.approx(TRUTH[name], rel=0.01), name


def test_the_gradient_is_that_of_the_cost_with_settled_states(windows: tuple[Record, ...]) -> None:
    linear = compose(AXIS)
    fit = GreyBoxFit(linear, windows, characteristic_scales(AXIS, windows, TRUTH), {"x": NOISE})
    coordinates = Coordinates.of(linear, ("m", "d", "k"), TRUTH, fit.scales)
    places = [
        first_state(fit.structure, record.record, {}) / fit.data.unlimited_sizes[:, 0]
        for record in fit.data.records
    ]
    low, high = [p - 20.0 for p in places], [p + 20.0 for p in places]
    theta = coordinates.from_values(TRUTH)

    def evaluated(at: np.ndarray) -> VariableProjection:
        problem = VariableProjection(fit.data, coordinates, places, low, high)
        problem.substeps = [4] * len(places)
        problem.settle_anew(at)
        return problem

    for i in range(3):
        step = np.zeros(3)
        step[i] = 1e-3
        above, below = (evaluated(theta + s).settle_anew(theta + s) for s in (step, -step))
        slope = 2.0 * evaluated(theta).at(theta).gradient[i]
        assert slope == pytest.approx((above - below) / 2e-3, rel=0.02, abs=1.0)


def test_a_start_that_cannot_be_simulated_is_said(windows: tuple[Record, ...]) -> None:
    found = problem_of(windows).fit_windows({**TRUTH, "k": -1e9}, ())
    assert not found.success
    assert found.message == "The start values cannot be simulated."
