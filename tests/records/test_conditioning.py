from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records.conditioning import TimeBase, time_base
from rigsight.records.record import Hold
from rigsight.records.resampling import Resampled, joined

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


def on_even_clock(stamps: np.ndarray, samples: np.ndarray, hold: Hold | None = None) -> Resampled:
    return joined("log.csv", {"x": samples}, {"x": base_of(stamps)}, {}, None, {"x": hold} if hold else {})


@pytest.mark.parametrize(("jitter", "error"), [(0.005, 1e-4), (0.05, 1e-4), (0.3, 1e-4), (1.0, 4e-3)])
def test_jitter_is_resampled_and_said_with_its_cost(jitter: float, error: float) -> None:
    rng = np.random.default_rng(1)
    dt = 0.01
    stamps = dt * (np.arange(N) + jitter * rng.uniform(0, 1, N))

    def signal(t: np.ndarray) -> np.ndarray:
        return np.sin(2 * np.pi * 4.0 * t)

    found = on_even_clock(stamps, signal(stamps))
    grid = found.t0 + found.dt * np.arange(found.samples["x"].size)
    assert grid.size >= N - 2
    assert found.dt == pytest.approx(dt, rel=0.01)
    assert np.abs(found.samples["x"] - signal(grid)).max() < error
    assert 0.0 < found.clock_uncertainty <= 1.05 * jitter * dt
    (note,) = found.notes
    assert "jitter" in note
    assert "x 0." in note.partition("Error at most about")[2]


def test_stamps_that_nearly_coincide_do_not_amplify_noise() -> None:
    rng = np.random.default_rng(4)
    stamps = 0.01 * (np.arange(N) + rng.uniform(0, 1, N))
    noise = 1e-3 * rng.standard_normal(N)
    found = on_even_clock(stamps, noise)
    assert np.std(found.samples["x"]) < 1.5e-3


def test_a_wandering_clock_is_resampled() -> None:
    steps = 0.01 * (1.0 + 0.3 * np.sin(np.arange(N) / 40))
    stamps = np.concatenate([[0.0], np.cumsum(steps)])
    found = on_even_clock(stamps, stamps**2)
    grid = found.t0 + found.dt * np.arange(found.samples["x"].size)
    np.testing.assert_allclose(found.samples["x"], grid**2, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("jitter", [0.05, 0.3, 1.0])
def test_a_held_input_keeps_impulse_and_timing(jitter: float) -> None:
    """The integral of the integral, which a mass without spring moves by, is that of the input held at its stamps."""
    rng = np.random.default_rng(2)
    stamps = 0.01 * (np.arange(N) + jitter * rng.uniform(0, 1, N))
    wave = np.sin(2 * np.pi * 2.0 * 0.01 * np.arange(N))
    found = on_even_clock(stamps, wave, "zoh")
    n = found.samples["x"].size
    speed = found.dt * np.concatenate([[0.0], np.cumsum(found.samples["x"])[:-1]])
    way = np.concatenate([[0.0], np.cumsum(found.dt * (speed + 0.5 * found.dt * found.samples["x"]))[:-1]])
    fine = found.t0 + found.dt * np.arange(200 * n) / 200
    held = wave[np.searchsorted(stamps, fine, "right") - 1]
    own_speed = np.concatenate([[0.0], np.cumsum(held)[:-1]]) * found.dt / 200
    own = (np.concatenate([[0.0], np.cumsum(own_speed)[:-1]]) * found.dt / 200)[::200]
    np.testing.assert_allclose(way, own, atol=2e-4 * own.max())


def test_a_held_input_steps_where_it_stepped_and_nowhere_else() -> None:
    rng = np.random.default_rng(2)
    stamps = 0.01 * (np.arange(N) + 0.3 * rng.uniform(0, 1, N))
    steps = np.where(np.arange(N) < N // 2, 0.0, 1.0)
    own = on_even_clock(stamps, steps, "zoh").samples["x"]
    np.testing.assert_array_equal(
        np.delete(own, range(N // 2 - 3, N // 2 + 4)),
        np.delete(steps, range(N // 2 - 3, N // 2 + 4))[: own.size - 7],
    )
    foh = on_even_clock(stamps, steps, "foh").samples["x"]
    assert foh.min() >= 0.0
    assert foh.max() <= 1.0


def test_coarse_stamps_of_an_even_clock_are_even() -> None:
    base = base_of(np.round(0.0033 * np.arange(N), 3))
    assert base.stamps is None
    assert base.dt == pytest.approx(0.0033, rel=1e-3)
    assert "steps of 0.001" in base.notes[0]


def broken(case: str) -> np.ndarray:
    t = 0.01 * np.arange(N)
    cases = {
        "short": t[:49],
        "backwards": np.concatenate([t[:100], t[50:]]),
        "falling": t[::-1],
        "duplicate": np.insert(t, 10, t[10]),
        "duplicate integer stamp": np.insert(np.arange(N), 200, 200),
        "gap": np.delete(t, [20, 21, 22]),
        "gap in integer stamps": np.delete(np.arange(N), 200),
        "too few digits": np.round(t / 15, 3),
        "logarithmic": np.geomspace(0.01, 10.0, N),
    }
    return cases[case]


@pytest.mark.parametrize(
    ("case", "reported"),
    [
        ("short", ["49 samples", "at least 50"]),
        ("backwards", ["line 102", "not increasing", "0.5 follows 0.99"]),
        ("falling", ["line 3", "not increasing"]),
        ("duplicate", ["line 13", "duplicate", "Delete the repeated row"]),
        ("duplicate integer stamp", ["line 203", "duplicate"]),
        ("gap", ["between lines 21 and 22", "3 samples are missing", "Split the record"]),
        ("gap in integer stamps", ["between lines 201 and 202", "1 samples are missing"]),
        ("too few digits", ["duplicate", "more digits"]),
        ("logarithmic", ["not equally spaced"]),
    ],
)
def test_unusable_time_is_told_with_line_and_mend(case: str, reported: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        base_of(broken(case))
    for fragment in ["log.csv", *reported]:
        assert fragment in str(caught.value)


def test_one_jump_of_the_clock_is_told_from_jitter() -> None:
    even = 0.01 * np.arange(400)
    jumping = time_base(even + 0.012 * (even > 2.0), np.arange(400), "run.csv")
    wandering = time_base(
        even + 0.005 * np.random.default_rng(0).uniform(size=400), np.arange(400), "run.csv"
    )
    assert jumping.n_far == 1
    assert jumping.jitter > 0.5
    assert wandering.n_far > 40
