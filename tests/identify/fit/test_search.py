"""Where a fit ends does not depend on the way there, also where sliders make its cost rough."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT, NOISE = 0.01, 2e-5
STRUCTURE = compose(AXIS, [effect_named("iwan_hysteresis")])
TRUTH = {
    "gain": 1.0, "m": 1.0, "d": 1.6, "x_off": 0.0, "force_off": 0.0, "k": 180.0, "a": 0.55, "x_s": 0.008, "q": -0.7,
}  # fmt: skip
FREE = ("m", "d", "k", "x_off", "a", "x_s", "q")


@pytest.fixture(scope="module")
def fit() -> GreyBoxFit:
    """Fit to two sweeps with noise."""
    rng = np.random.default_rng(0)
    t = DT * np.arange(2000)
    records = []
    for size in (0.3, 1.0):
        run = Record(
            f"{size}", DT, {"u": linear_sweep(t, size, 1.0, 30.0)}, {}, role="estimation", hold="zoh"
        )
        clean = simulate(STRUCTURE, TRUTH, run)
        records.append(clean.with_signals(x=clean["x"] + rng.normal(scale=NOISE, size=t.size)))
    return GreyBoxFit(STRUCTURE, records, characteristic_scales(AXIS, records, TRUTH), {"x": NOISE})


def test_nearby_starts_end_at_one_place(fit: GreyBoxFit) -> None:
    """Derivatives alone left a hundredth of a standard error here, and up to a tenth beside other kinks."""
    first, second = (fit.fit({**TRUTH, "k": k}, FREE) for k in (180.0, 180.0001))
    for name in FREE:
        assert abs(second.values[name] - first.values[name]) < 0.003 * first.standard_errors[name], name


def test_that_place_is_as_good_as_the_truth(fit: GreyBoxFit) -> None:
    """Seven parameters and initial states take up noise, so that a minimum leaves less than the truth does."""
    assert fit.fit(TRUTH, FREE).cost < fit.fit(TRUTH, ()).cost


@pytest.mark.parametrize("x_s", [0.3, 0.6])
@pytest.mark.parametrize("q", [-0.3, 0.3, 0.8])
def test_a_spring_three_times_too_stiff_comes_back(fit: GreyBoxFit, x_s: float, q: float) -> None:
    """Bounds that are far away stopped five of these fits after three or four evaluations, at 60 to 450 times the noise."""
    start = {**TRUTH, "k": 3.0 * TRUTH["k"], "a": TRUTH["a"] / 3.0, "x_s": x_s * TRUTH["x_s"], "q": q}
    assert fit.fit(start, FREE, max_evaluations=60, tolerance=1e-5, finish=False).weighted_rms < 1.05
