"""What pulsates by itself stands at one frequency in all records; what a wrong model leaves does not."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.excitation import linear_sweep
from rigsight.frequency.persistent_line import persistent_line

DT = 0.01


def records(pulsation: float, size: float) -> list[np.ndarray]:
    """Return three residuals: a sweep that a model does not follow, noise, and a line of its own phase."""
    rng = np.random.default_rng(0)
    found = []
    for n_samples, amplitude in ((4000, 1.0), (4000, 2.0), (3000, 0.5)):
        t = DT * np.arange(n_samples)
        sweep = linear_sweep(t, amplitude, 1.0, 60.0)
        line = size * np.sin(pulsation * t + rng.uniform(0.0, 6.0))
        found.append(sweep + line + 0.05 * rng.standard_normal(n_samples))
    return found


@pytest.mark.parametrize("pulsation", [3.0, 11.5, 40.0])
def test_a_line_is_found_below_a_sweep_that_is_larger(pulsation: float) -> None:
    found = persistent_line(records(pulsation, 0.4), [DT] * 3)
    assert found == pytest.approx(pulsation, abs=2.0 * np.pi / 30.0 / 2.0)


def test_a_line_in_one_record_alone_is_none() -> None:
    t = DT * np.arange(4000)
    rng = np.random.default_rng(1)
    once = [rng.standard_normal(4000) + (5.0 * np.sin(20.0 * t) if i == 0 else 0.0) for i in range(8)]
    everywhere = [row + 0.5 * np.sin(7.0 * t) for row in once]
    assert persistent_line(everywhere, [DT] * 8) == pytest.approx(7.0, abs=0.15)


def test_a_record_of_few_samples_tells_nothing() -> None:
    assert persistent_line([np.ones(20)], [DT]) is None
    assert persistent_line([], []) is None
