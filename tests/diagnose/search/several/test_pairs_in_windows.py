"""A pair whose fit to whole records stopped short is found in windows, where chance has no time to grow."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.search.horizon import pairs_in_windows
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.effects import effect_named
from rigsight.identify import characteristic_scales
from rigsight.identify.fit.windows import Windowing, liveliest
from rigsight.rigs import AXIS

from ..test_sensitive_motion import NOISE, RIG, measured

TRUTH = {**RIG, "g": 1.35e-4, "u_0": 0.1}
PAIR = (effect_named("backlash"), effect_named("input_dead_zone"))


@pytest.fixture
def benches() -> tuple[FitContext, FitContext]:
    """The bench of whole records, and that of windows of four cycles."""
    records = measured([effect.name for effect in PAIR], {"g": 1.35e-4, "u_0": 0.1}, 3000)
    made = []
    for windowing in (Windowing(), Windowing(cycles=VERDICT.window_cycles, noise={"x": NOISE})):
        fitted, scored = windowing.cut(records[:2]), windowing.cut(records[2:])
        look = liveliest(fitted, AXIS, 8000)
        scales = characteristic_scales(AXIS, records, RIG)
        made.append(
            FitContext(AXIS, fitted, scored, look, scales, {"x": NOISE}, frozenset({"gain"}), start=RIG)
        )
    return made[0], made[1]


@pytest.mark.slow
def test_a_pair_that_stopped_short_reaches_the_noise(benches: tuple[FitContext, FitContext]) -> None:
    whole, windows = benches
    reidentified = reidentify(whole, RIG)
    structure = whole.composed(PAIR)
    beside = {**TRUTH, "g": 3e-4, "u_0": 0.05}
    free = whole.free_parameters(structure)
    short = whole.problem(structure, whole.estimation).fit(beside, free, max_evaluations=1)
    stopped = whole.score(PAIR, replace(short, values=beside))
    assert stopped.error_over_noise > 3.0
    (found,) = pairs_in_windows(whole, windows, reidentified, [stopped])
    assert found.error_over_noise == pytest.approx(1.0, abs=0.1)
    assert found.fit.values["u_0"] == pytest.approx(0.1, rel=0.02)
    assert found.fit.values["g"] == pytest.approx(1.35e-4, rel=0.02)
