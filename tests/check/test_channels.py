"""Noise and signal over noise of a channel are those that were put into it."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.check import Channel
from rigsight.check.channels import checked_record
from rigsight.records import Record
from rigsight.rigs import AXIS

from .axis_records import DT, NOISE, campaign, swept


def channel(record: Record, name: str) -> Channel:
    return next(own for own in checked_record(AXIS, record).channels if own.name == name)


def test_noise_of_a_sensor_is_found_and_a_clean_command_has_none() -> None:
    record = campaign(swept(n=6000)).records[0]
    assert channel(record, "x").noise == pytest.approx(NOISE, rel=0.2)
    assert channel(record, "u").noise < 1e-3 * channel(record, "u").std


@pytest.mark.parametrize("command", ["step", "sweep to the end of the band"])
def test_a_signal_that_fills_the_band_is_no_noise(command: str) -> None:
    t = DT * np.arange(4000)
    u = 5.0 * np.heaviside(t - 2.0, 1.0) if command == "step" else np.sin(np.pi * 0.5 / DT * t**2 / t[-1])
    assert channel(Record("r", DT, {"u": u, "x": u}, {}), "u").noise == 0.0


def test_signal_over_noise_is_the_ratio_of_the_powers() -> None:
    rng = np.random.default_rng(1)
    u = rng.standard_normal(2**16)
    record = Record("r", DT, {"u": u, "x": u + 0.1 * rng.standard_normal(u.size)}, {})
    ratios = [octave.signal_over_noise for octave in channel(record, "x").octaves[6:]]
    assert ratios == pytest.approx([20.0] * len(ratios), abs=0.5)


def test_octaves_without_a_signal_are_not_usable() -> None:
    rng = np.random.default_rng(2)
    record = Record("r", DT, {"u": rng.standard_normal(2**15), "x": rng.standard_normal(2**15)}, {})
    assert channel(record, "x").usable is None
