"""Does the smoother give back motion and missing force that only noisy displacement shows?"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rigsight.discover import RegressionData
from rigsight.discover.motion import Rows, motion_of, windows

Make = Callable[..., tuple[dict[str, float], RegressionData]]


@pytest.mark.parametrize("noise", [2e-6, 2e-5, 2e-4])
def test_the_missing_force_is_seen_through_the_noise(noise: float, make_data: Make) -> None:
    values, data = make_data("cubic", noise, amplitudes=(1.0,), validation=False)
    (record,) = data.records
    _, clean = make_data("cubic", 1e-12, amplitudes=(1.0,), validation=False)
    x = clean.records[0]["x"]
    motion = motion_of(data.rig, record, values, noise)
    assert np.std(motion.x - x) < 0.6 * noise
    force = (
        values["m"] * motion.acceleration + values["d"] * motion.v + values["k"] * motion.x - 0.8 * motion.u
    )
    missing = -values["k_3"] * x**3
    inner = slice(50, -50)
    assert np.corrcoef(force[inner], missing[inner])[0, 1] > (0.99 if noise < 1e-4 else 0.9)


def test_windows_give_the_derivatives_of_a_sine() -> None:
    dt, omega = 1e-3, 12.0
    t = dt * np.arange(4000)
    rows = Rows(0.05)
    own = windows(0.05, dt)
    middle = t[own.weights.shape[1] // 2 :][: t.size - own.weights.shape[1] + 1][:: own.step]
    # A window averages the sine; value and rate are averaged alike.
    shrunk = rows.of(np.sin(omega * t), dt) / np.where(
        np.abs(np.sin(omega * middle)) > 0.1, np.sin(omega * middle), np.nan
    )
    factor = np.nanmedian(shrunk)
    rate = rows.rate_of(np.sin(omega * t), dt)
    np.testing.assert_allclose(rate, factor * omega * np.cos(omega * middle), atol=1e-6 * omega)
