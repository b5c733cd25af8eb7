"""Rigs of any shape are drawn by their equations alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigsight.rigs import RIGS
from rigsight.simulate import compose, simulate
from rigsight.simulate.linearization import linearize
from rigsight_bench.trials import any_rig_numbers
from rigsight_bench.trials.any_rig_campaign import draw_amplitudes, multisines, sweeps
from rigsight_bench.trials.any_rig_numbers import DAMPING_RATIOS, FREQUENCIES, draw_numbers
from rigsight_bench.trials.runs import Run


@pytest.mark.parametrize("name", ["servo", "quarter_car", "element"])
def test_numbers_lie_within_their_bounds_and_the_rig_vibrates_within_its_bands(name: str) -> None:
    rig = RIGS[name]
    values = draw_numbers(rig, np.random.default_rng(3))
    assert all(p.lower <= values[p.name] <= p.upper for p in (*rig.constants, *rig.parameters))
    found = linearize(compose(rig), values)
    assert found.stability != "unstable"
    vibrating = found.poles[np.abs(found.poles.imag) > 0.0]
    frequencies, ratios = np.abs(vibrating), -vibrating.real / np.abs(vibrating)
    assert np.all((frequencies >= FREQUENCIES[0]) & (frequencies <= FREQUENCIES[1]))
    assert np.all((ratios >= DAMPING_RATIOS[0]) & (ratios <= DAMPING_RATIOS[1]))


def test_no_number_depends_on_what_a_rig_or_its_parameters_are_called() -> None:
    source = Path(any_rig_numbers.__file__).read_text(encoding="utf-8")
    for name, rig in RIGS.items():
        assert f'"{name}"' not in source
        assert not [p.name for p in rig.parameters if f'"{p.name}"' in source]


def test_all_inputs_move_and_a_control_law_is_left_in_its_range_for_most_of_the_time() -> None:
    rig = RIGS["servo"]
    values = draw_numbers(rig, np.random.default_rng(3))
    rng = np.random.default_rng(4)
    amplitudes, band = draw_amplitudes(rig, values, rng)
    for waves in (sweeps(amplitudes, band, rng), multisines(amplitudes, band, rng)):
        record = Run("run", "estimation", "operation", "band_limited", waves, 4000).record()
        shown = simulate(compose(rig), values, record)
        told = values["k_p"] * (record["goal"] - shown["angle"])
        assert np.ptp(record["goal"]) > 0.0
        assert np.mean(np.abs(told) < 1.0) > 0.8
