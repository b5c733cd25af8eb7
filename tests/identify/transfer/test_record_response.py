"""What a record shows over frequency by each method, and how fine it is."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.excitation import linear_sweep
from rigsight.identify.transfer.record_response import METHODS, driven_band, record_response
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}


def measured(u: np.ndarray, noise: float = 1e-5) -> Record:
    record = Record("r", 5e-3, {"u": u}, {"u": "N", "x": "m"}, kind="sweep")
    clean = simulate(compose(AXIS), VALUES, record)
    return clean.with_signals(x=clean["x"] + np.random.default_rng(1).normal(scale=noise, size=u.size))


@pytest.fixture(scope="module")
def sweep() -> Record:
    return measured(linear_sweep(5e-3 * np.arange(8000), 2.0, 2.0, 60.0))


def truth(omega: np.ndarray) -> np.ndarray:
    return np.asarray(1.0 / (800.0 - 2.0 * omega**2 + 5.0j * omega))


@pytest.mark.parametrize("method", METHODS)
def test_every_method_shows_the_magnitude_of_the_rig(method, sweep: Record) -> None:  # type: ignore[no-untyped-def]
    found = record_response(sweep, "u", "x", "pt2", method, hold="foh", band=(5.0, 40.0)).response
    error = np.abs(found.values) / np.abs(truth(found.omega)) - 1.0
    assert np.sqrt(np.mean(error**2)) < (0.1 if method in ("h1", "thesis") else 0.01)


def test_the_coherence_of_a_linear_rig_is_high(sweep: Record) -> None:
    coherence = record_response(sweep, "u", "x", "pt2", hold="foh").coherence
    assert coherence is not None
    assert coherence.coherence is not None
    assert np.median(coherence.coherence) > 0.95


def test_no_coherence_is_there_where_nobody_reads_it(sweep: Record) -> None:
    bare = record_response(sweep, "u", "x", "pt2", hold="foh", with_coherence=False)
    assert bare.coherence is None
    assert np.array_equal(
        bare.response.values, record_response(sweep, "u", "x", "pt2", hold="foh").response.values
    )


def test_a_wider_resolution_is_one(sweep: Record) -> None:
    fine, wide = (record_response(sweep, "u", "x", "pt2", hold="foh", resolution=r) for r in (None, 5.0))
    assert wide.resolution > fine.resolution
    assert wide.narrowest > fine.narrowest
    with pytest.raises(InputError, match="too short for a resolution"):
        record_response(sweep, "u", "x", "pt2", resolution=1e-3)


def test_periods_are_averaged_without_the_first() -> None:
    rng = np.random.default_rng(2)
    n = 2048
    lines = np.zeros(n // 2 + 1, dtype=complex)
    lines[1:300] = np.exp(2j * np.pi * rng.uniform(size=299))
    period = 40.0 * np.fft.irfft(lines, n)
    found = record_response(measured(np.tile(period, 4), 1e-6), "u", "x", "pt2", hold="foh").response
    assert "mean of periods 2 to 4" in found.method
    error = np.abs(found.values - truth(found.omega)) / np.abs(truth(found.omega))
    assert np.median(error) < 0.01


def test_the_driven_band_of_a_sweep_is_the_sweep(sweep: Record) -> None:
    low, high = driven_band(sweep, "u")
    assert low == pytest.approx(2.0, abs=0.6)
    assert high == pytest.approx(60.0, abs=1.5)


def test_the_order_of_the_signals_in_a_record_changes_nothing() -> None:
    rng = np.random.default_rng(2)
    lines = np.zeros(1025, dtype=complex)
    lines[1:300] = np.exp(2j * np.pi * rng.uniform(size=299))
    record = measured(np.tile(40.0 * np.fft.irfft(lines, 2048), 4))
    turned = Record(
        "r", record.dt, {name: record[name] for name in ("x", "u")}, record.units, kind="multisine"
    )
    found, other = (record_response(r, "u", "x", "pt2", hold="foh").response for r in (record, turned))
    assert other.method == found.method
    assert np.array_equal(other.values, found.values)


def test_a_measured_source_has_the_periods_of_what_drives_it() -> None:
    rng = np.random.default_rng(2)
    lines = np.zeros(1025, dtype=complex)
    lines[1:300] = np.exp(2j * np.pi * rng.uniform(size=299))
    record = measured(np.tile(40.0 * np.fft.irfft(lines, 2048), 4), noise=3e-3)
    record = record.with_signals(y=np.cumsum(record["x"]))
    assert "mean of periods" not in record_response(record, "x", "y", "pt1").response.method
    assert "mean of periods 2 to 4" in record_response(record, "x", "y", "pt1", drive="u").response.method
