"""Signals with clocks of their own: joined on one, with a note; refused only where clocks cannot be compared."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ReadingOptions, Record, read_record

from .formats.files import write_text


@dataclass(frozen=True)
class Named:
    name: str
    unit: str


def write_two_rates(path: Path, start: float = 0.0) -> None:
    """An input every 0.02 s and an output every 0.01 s."""
    nptdms = pytest.importorskip("nptdms")
    slow, fast = 0.02 * np.arange(200), 0.01 * np.arange(400) + start
    channels = [
        nptdms.ChannelObject("log", name, samples, properties={"wf_increment": dt, "wf_start_offset": t0})
        for name, samples, dt, t0 in (
            ("u", np.sin(3 * slow), 0.02, 0.0),
            ("x", np.sin(3 * fast - 0.4), 0.01, start),
        )
    ]
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(channels)


def read(path: Path, **options: object) -> Record:
    return read_record(path, (Named("u", "input"),), (Named("x", "m"),), ReadingOptions(**options))


def test_different_rates_come_onto_the_finest_clock(tmp_path: Path) -> None:
    write_two_rates(tmp_path / "run.tdms")
    record = read(tmp_path / "run.tdms")
    assert (record.dt, record.t0, record.n_samples) == (0.01, 0.0, 399)
    assert record.clock_uncertainty == pytest.approx(0.02)
    (note,) = record.notes
    for part in ("every 0.02 s", "every 0.01 s", "clocks of their own", "u by cubic splines, from 0.02 s"):
        assert part in note


@pytest.mark.parametrize("hold", ["foh", "zoh"])
def test_different_starts_are_joined_on_the_clock_of_a_held_input(tmp_path: Path, hold: str) -> None:
    write_two_rates(tmp_path / "run.tdms", start=0.005)
    record = read(tmp_path / "run.tdms", hold=hold)
    assert record.dt == 0.01
    np.testing.assert_allclose(record["x"], np.sin(3 * record.t - 0.4), atol=1e-7)
    held = np.sin(3 * 0.02 * np.floor(record.t / 0.02 + 1e-6))
    np.testing.assert_allclose(record["u"], held if hold == "zoh" else np.sin(3 * record.t), atol=5e-4)


@pytest.mark.parametrize(
    ("hold", "manner", "error"),
    [("foh", "cubic", 1e-5), ("zoh", "held", 0.06), ("band_limited", "cubic", 1e-5)],
)
def test_each_hold_has_its_manner(tmp_path: Path, hold: str, manner: str, error: float) -> None:
    write_two_rates(tmp_path / "run.tdms")
    record = read(tmp_path / "run.tdms", resample=0.01, hold=hold)
    np.testing.assert_array_equal(record["x"], np.sin(3 * (0.01 * np.arange(400)) - 0.4)[:399])
    np.testing.assert_allclose(record["u"], np.sin(3 * record.t), atol=error)
    np.testing.assert_allclose(record["u"][::2], np.sin(3 * (0.02 * np.arange(200))), atol=1e-12)
    (note,) = record.notes
    assert f"u {manner}" in note or f"u by {manner}" in note
    assert "; x " not in note.partition("Resampled")[2]


def test_the_axis_is_what_all_signals_cover(tmp_path: Path) -> None:
    write_two_rates(tmp_path / "run.tdms", start=0.105)
    record = read(tmp_path / "run.tdms", resample=0.01)
    assert record.t0 == pytest.approx(0.105)
    assert record.t[-1] <= 3.98 + 1e-9
    np.testing.assert_allclose(record["u"], np.sin(3 * record.t), atol=5e-4)


@pytest.mark.parametrize("hold", ["foh", "zoh", "band_limited"])
def test_a_coarser_clock_loses_what_is_faster_and_delays_nothing(tmp_path: Path, hold: str) -> None:
    t = 0.001 * np.arange(6000)
    slow, fast = np.sin(6.0 * t - 0.3), np.sin(2 * np.pi * 187.0 * t)
    write_text(tmp_path / "run.csv", {"t": t, "u": slow + fast, "x": slow + fast}, {})
    record = read(tmp_path / "run.csv", resample=0.01, hold=hold)
    assert record.dt == 0.01
    inner = slice(20, -20)
    np.testing.assert_allclose(record["x"][inner], np.sin(6.0 * record.t - 0.3)[inner], atol=2e-3)
    # A held sample stands for the time behind it.
    held = 0.0005 if hold == "zoh" else 0.0
    np.testing.assert_allclose(record["u"][inner], np.sin(6.0 * (record.t - held) - 0.3)[inner], atol=2e-3)
    assert record.hold == "band_limited"
    assert "faster than 40 Hz is lost" in record.notes[0]


def test_signals_that_hardly_overlap_are_refused(tmp_path: Path) -> None:
    write_two_rates(tmp_path / "run.tdms", start=3.9)
    with pytest.raises(InputError, match=r"in common.*at least 50"):
        read(tmp_path / "run.tdms", resample=0.01)


def test_the_own_rate_changes_nothing_and_is_not_told(tmp_path: Path) -> None:
    t = 0.01 * np.arange(100)
    write_text(tmp_path / "run.csv", {"t": t, "u": np.sin(9 * t), "x": np.cos(9 * t)}, {})
    plain, same = read(tmp_path / "run.csv"), read(tmp_path / "run.csv", resample=0.01)
    assert (same.dt, same.t0, same.notes) == (plain.dt, plain.t0, ())
    np.testing.assert_array_equal(same["x"], plain["x"])


@pytest.mark.slow
def test_groups_with_a_time_each_go_by_their_own(tmp_path: Path) -> None:
    from scipy.io import savemat

    slow, fast = 0.02 * np.arange(200), 0.01 * np.arange(400) + 0.003
    content = {"drive": {"t": slow, "u": np.sin(slow)}, "stage": {"t": fast, "x": np.cos(fast)}}
    savemat(tmp_path / "run.mat", content)
    record = read(tmp_path / "run.mat", hold="band_limited")
    np.testing.assert_allclose(record["u"], np.sin(record.t), atol=1e-6)
    np.testing.assert_allclose(record["x"], np.cos(record.t), atol=1e-6)
    assert read(tmp_path / "run.mat", resample=0.005).dt == 0.005


def test_a_time_of_another_length_is_told(tmp_path: Path) -> None:
    from scipy.io import savemat

    t = 0.02 * np.arange(200)
    savemat(tmp_path / "run.mat", {"t": t, "u": np.sin(t), "x": np.cos(0.01 * np.arange(400))})
    with pytest.raises(InputError, match=r"'x' has 400 samples, but the time 't' 200.*time = "):
        read(tmp_path / "run.mat")
