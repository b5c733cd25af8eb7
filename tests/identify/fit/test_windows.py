"""Windows cover a record completely and are long against the motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.excitation import linear_sweep
from rigsight.identify.fit.windows import Windowing, cut, readings, window_length
from rigsight.records import Record
from rigsight.rigs import AXIS

DT = 5e-3


def moving(frequency: float, n_samples: int = 8000, name: str = "r", drift: float = 0.0) -> Record:
    t = DT * np.arange(n_samples)
    x = np.sin(2.0 * np.pi * frequency * t) / frequency + drift * t
    return Record(name=name, dt=DT, signals={"u": x, "x": x}, units={}, role="validation", t0=3.0)


def test_windows_join_to_the_record() -> None:
    record = moving(2.0)
    windows = cut([record], 3.3)
    np.testing.assert_array_equal(np.concatenate([w["x"] for w in windows]), record["x"])
    np.testing.assert_allclose(np.concatenate([w.t for w in windows]), record.t, atol=1e-9)


def test_windows_are_as_long_as_wished_or_a_little_longer() -> None:
    length = 3.3
    windows = cut([moving(2.0)], length)
    sizes = np.array([w.n_samples for w in windows])
    assert len(windows) == 12
    assert np.all(sizes * DT >= length - DT)
    assert np.ptp(sizes) <= 1


def test_windows_keep_role_and_tell_their_record() -> None:
    windows = cut([moving(2.0, name="a"), moving(2.0, name="b")], 20.0)
    assert all(w.role == "validation" for w in windows)
    assert len({w.name for w in windows}) == len(windows) == 4
    assert [w.name[0] for w in windows] == ["a", "a", "b", "b"]


def test_a_record_may_be_called_as_a_window_is() -> None:
    whole = moving(2.0, name="a window 1")
    windows = cut([whole, moving(2.0, name="a")], 20.0)
    assert [w.name for w in windows] == [
        "a window 1 window 1",
        "a window 1 window 2",
        "a window 1",
        "a window 2",
    ]
    assert [w.origin for w in windows] == ["a window 1", "a window 1", "a", "a"]
    assert list(readings([whole], "x")) == ["a window 1"]
    # A window of a window is of the same record.
    assert {w.origin for w in cut(windows[:1], 5.0)} == {"a window 1"}


def test_no_length_leaves_records_whole() -> None:
    records = [moving(2.0), moving(1.0)]
    assert cut(records, None) == tuple(records)


def test_a_window_holds_a_sample_however_short_it_should_be() -> None:
    assert [w.n_samples for w in cut([moving(2.0, 300)], 1e-6)] == 300 * [1]


def test_a_record_shorter_than_the_window_stays_whole() -> None:
    record = moving(2.0, 300)
    (window,) = cut([record], 100.0)
    assert window.n_samples == 300


@pytest.mark.parametrize("drift", [0.0, 50.0])
def test_a_window_holds_ten_periods_of_the_motion_whatever_its_drift(drift: float) -> None:
    assert window_length(AXIS, [moving(2.0, drift=drift)]) == pytest.approx(5.0, rel=0.05)


def test_a_window_is_no_longer_than_the_longest_record() -> None:
    assert window_length(AXIS, [moving(0.1, 2000)]) == pytest.approx(2000 * DT)


def test_a_fast_motion_in_a_long_record_keeps_the_number_of_windows_small() -> None:
    record = moving(60.0, 40000)
    windows = cut([record], window_length(AXIS, [record]))
    assert len(windows) <= 40


def test_a_window_keeps_enough_samples_for_its_initial_state() -> None:
    assert window_length(AXIS, [moving(80.0, 1000)]) >= 100 * DT


def swept(n_samples: int = 8000, quiet: int = 500) -> Record:
    t = DT * np.arange(n_samples)
    x = linear_sweep(t, 1.0, 1.0, 40.0)
    x[:quiet] = 0.0
    return Record("sweep", DT, {"x": x}, {"x": "m"}, role="estimation")


def test_windows_of_cycles_join_to_the_record_and_hold_as_many_cycles_each() -> None:
    record = swept()
    windows = Windowing(cycles=4, noise={"x": 1e-3}).cut([record])
    np.testing.assert_array_equal(np.concatenate([w["x"] for w in windows]), record["x"])
    cycles = [np.count_nonzero((w["x"][:-1] < 0.0) & (w["x"][1:] >= 0.0)) for w in windows[1:-1]]
    assert len(cycles) > 10
    assert {3, 4, 5} >= set(cycles)
    assert windows[1].n_samples > 3 * windows[-2].n_samples
    assert all(w.role == "estimation" for w in windows)


def test_windows_of_cycles_are_long_enough_to_fit_an_initial_state() -> None:
    windows = Windowing(cycles=4, noise={"x": 1e-3}).cut([swept(2000, quiet=0)])
    assert min(w.n_samples for w in windows) >= 60


def test_noise_makes_no_cycles() -> None:
    rng = np.random.default_rng(0)
    record = Record("rest", DT, {"x": 1e-3 * rng.standard_normal(4000)}, {"x": "m"})
    assert len(Windowing(cycles=4, noise={"x": 1e-3}).cut([record])) < 4


def test_without_length_and_cycles_records_stay_whole() -> None:
    record = swept()
    assert Windowing().whole
    assert Windowing().cut([record]) == (record,)
    assert not Windowing(length=3.3).whole
    assert len(Windowing(length=3.3).cut([record])) == len(cut([record], 3.3))


def test_cycles_are_those_of_a_sensor_that_the_record_holds() -> None:
    record = swept()
    named = replace(record, signals={"load": record["x"]})
    windows = Windowing(cycles=4, noise={"x": 1e-3, "load": 1e-3}).cut([record, named])
    assert [w.n_samples for w in windows[: len(windows) // 2]] == [
        w.n_samples for w in windows[len(windows) // 2 :]
    ]
