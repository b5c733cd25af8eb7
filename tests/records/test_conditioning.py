from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records.conditioning import TimeBase, time_base

N = 400


def base_of(stamps: np.ndarray) -> TimeBase:
    return time_base(np.asarray(stamps, dtype=float), np.arange(2, len(stamps) + 2), "log.csv")


def printed(stamps: np.ndarray, form: str) -> np.ndarray:
    return np.array([float(format(stamp, form)) for stamp in stamps])


@pytest.mark.parametrize("dt", [1 / 750, 1e-3, 1.0, 1 / 600, 2.5e-6])
@pytest.mark.parametrize("form", [".9g", ".17g", ".7g"])
def test_rounding_of_printed_stamps_is_not_jitter(dt: float, form: str) -> None:
    base = base_of(printed(3.0 * dt + dt * np.arange(N), form))
    assert base.stamps is None
    assert base.notes == ()
    assert base.dt == pytest.approx(dt, rel=1e-5)


def test_decimals_cut_off_are_not_jitter() -> None:
    base = base_of(np.floor(np.arange(N) / 750 * 1e6) / 1e6)
    assert base.stamps is None
    assert base.dt == pytest.approx(1 / 750, rel=1e-5)


def test_a_plain_sample_time_is_found_exactly() -> None:
    assert base_of(5.0 + 0.001 * np.arange(N)).dt == 0.001


def test_half_a_percent_of_jitter_is_resampled_and_said() -> None:
    rng = np.random.default_rng(1)
    dt = 0.01
    stamps = dt * (np.arange(N) + 0.005 * rng.uniform(-1, 1, N))
    base = base_of(stamps)
    assert len(base.notes) == 1
    assert "jitter" in base.notes[0]
    grid = base.t0 + base.dt * np.arange(N)

    def signal(t: np.ndarray) -> np.ndarray:
        return np.sin(2 * np.pi * 5.0 * t)

    before = np.abs(signal(stamps) - signal(grid)).max()
    after = np.abs(base.resample(signal(stamps)) - signal(grid)).max()
    assert after < 0.1 * before


def test_a_wandering_clock_is_resampled() -> None:
    steps = 0.01 * (1.0 + 0.008 * np.sin(np.arange(N) / 40))
    stamps = np.concatenate([[0.0], np.cumsum(steps)])
    base = base_of(stamps)
    grid = base.t0 + base.dt * np.arange(N + 1)
    np.testing.assert_allclose(base.resample(stamps**2), grid**2, rtol=1e-9, atol=1e-12)


def test_a_held_input_keeps_its_levels() -> None:
    rng = np.random.default_rng(2)
    base = base_of(0.01 * (np.arange(N) + 0.005 * rng.uniform(-1, 1, N)))
    steps = np.where(np.arange(N) < N // 2, 0.0, 1.0)
    np.testing.assert_array_equal(base.resample(steps, "zoh"), steps)
    foh = base.resample(steps, "foh")
    assert foh.min() >= 0.0
    assert foh.max() <= 1.0


def broken(case: str) -> np.ndarray:
    t = 0.01 * np.arange(N)
    rng = np.random.default_rng(3)
    cases = {
        "short": t[:49],
        "backwards": np.concatenate([t[:100], t[50:]]),
        "falling": t[::-1],
        "duplicate": np.insert(t, 10, t[10]),
        "duplicate integer stamp": np.insert(np.arange(N), 200, 200),
        "gap": np.delete(t, [20, 21, 22]),
        "gap in integer stamps": np.delete(np.arange(N), 200),
        "jitter": t + 0.01 * 0.05 * rng.uniform(-1, 1, N),
        "too few digits": np.round(t / 15, 3),
        "logarithmic": np.geomspace(0.01, 10.0, N),
    }
    return cases[case]


@pytest.mark.parametrize(
    ("case", "told"),
    [
        ("short", ["49 samples", "at least 50"]),
        ("backwards", ["line 102", "not increasing", "0.5 follows 0.99"]),
        ("falling", ["line 3", "not increasing"]),
        ("duplicate", ["line 13", "duplicate", "Delete the repeated row"]),
        ("duplicate integer stamp", ["line 203", "duplicate"]),
        ("gap", ["between lines 21 and 22", "3 samples are missing", "Split the record"]),
        ("gap in integer stamps", ["between lines 201 and 202", "1 samples are missing"]),
        ("jitter", ["not equally spaced", "jitter", "Resample"]),
        ("too few digits", ["duplicate", "more digits"]),
        ("logarithmic", ["not equally spaced"]),
    ],
)
def test_unusable_time_is_told_with_line_and_mend(case: str, told: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        base_of(broken(case))
    for fragment in ["log.csv", *told]:
        assert fragment in str(caught.value)
