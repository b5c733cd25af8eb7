"""Records that are sampled much finer than anything moves are compared as means, and say the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.data_quality.oversampling import at_useful_rate
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}


def campaign(dt: float, n_samples: int, noise: float = 0.0, period: float | None = None) -> Campaign:
    t, rng = dt * np.arange(n_samples), np.random.default_rng(0)
    u = np.sin(4.0 * t) + 0.5 * np.sin(11.0 * t)
    if period is not None:
        u = np.sin(2.0 * np.pi * t / period) + 0.5 * np.sin(6.0 * np.pi * t / period)
    clean = simulate(compose(AXIS), VALUES, Record("run", dt, {"u": u}, {}, hold="zoh"))
    measured = clean.with_signals(x=clean["x"] + rng.normal(scale=noise, size=n_samples))
    return Campaign("fine", AXIS, {"gain": 1.0}, {}, (measured,))


def test_means_follow_the_same_equations() -> None:
    coarser = at_useful_rate(campaign(5e-4, 60_000))
    (record,) = coarser.records
    assert record.dt == pytest.approx(2.5e-3)
    assert record.t0 == pytest.approx(2 * 5e-4)
    again = simulate(compose(AXIS), VALUES, record)
    settled = record.n_samples // 2
    assert np.std(again["x"][settled:] - record["x"][settled:]) < 2e-4 * np.std(record["x"])
    (note,) = coarser.notes
    assert "means of 5 samples" in note


def test_noise_falls_as_if_every_sample_were_used() -> None:
    quiet, noisy = (at_useful_rate(campaign(5e-4, 60_000, noise)).records[0] for noise in (0.0, 1e-4))
    assert np.std(noisy["x"] - quiet["x"]) == pytest.approx(1e-4 / np.sqrt(5), rel=0.05)


@pytest.mark.parametrize(("dt", "n_samples"), [(5e-4, 8_000), (2e-2, 40_000)])
def test_few_samples_and_coarse_ones_stay(dt: float, n_samples: int) -> None:
    records = campaign(dt, n_samples)
    assert at_useful_rate(records) is records


def test_samples_that_show_a_fault_stay() -> None:
    records = campaign(5e-4, 60_000, noise=1e-4)
    (record,) = records.records
    clipped = replace(records, records=(record.with_signals(x=np.minimum(record["x"], 0.005)),))
    assert at_useful_rate(clipped) is clipped


def test_periods_that_means_would_not_repeat_stay() -> None:
    # A period of 4000 samples is no whole number of means of three.
    records = campaign(5e-4, 40_000, noise=1e-4, period=4000 * 5e-4)
    assert at_useful_rate(records) is records
