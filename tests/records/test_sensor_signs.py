"""Codes for no reading, ends of a turn, and readings held over rows are found, and what only looks like them is not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.records.sensor_signs import begins_again, codes, held, is_wrapped, wrapping_counter

T = 1e-3 * np.arange(8000)
MOTION = 2.0 * np.sin(3.0 * T) + np.sin(11.0 * T)
TURN = 2.0 * np.pi


def _with(samples: NDArray[np.float64], value: float, *places: int) -> NDArray[np.float64]:
    samples = samples.copy()
    samples[list(places)] = value
    return samples


@pytest.mark.parametrize(
    "value",
    [9.9e37, -9.9e37, 9.91e37, 9.9e34, 1e30, 3.4028235e38, -9999.0, -999.0, -999.25, 65535.0, -32768.0],
)
def test_a_code_is_found_with_its_samples(value: float) -> None:
    (code,) = codes(_with(MOTION, value, 40, 41, 900))
    assert (code.value, code.samples.tolist()) == (value, [40, 41, 900])


def test_each_of_two_codes_is_found() -> None:
    samples = _with(_with(MOTION, 9.9e37, 7), -9999.0, 70)
    assert [(code.value, code.samples.tolist()) for code in codes(samples)] == [
        (-9999.0, [70]),
        (9.9e37, [7]),
    ]


@pytest.mark.parametrize(
    "samples",
    [
        np.where(T < 1.0, 0.0, 9999.0),
        np.where(T % 2.0 < 1.0, -9999.0, 9999.0),
        np.minimum(np.round(2e4 * T), 65535.0),
        1e35 * MOTION,
        _with(MOTION, 1234.5, 40),
    ],
    ids=["step", "square wave", "saturated converter", "large unit", "no code"],
)
def test_a_level_that_a_signal_reaches_by_itself_is_no_code(samples: NDArray[np.float64]) -> None:
    assert codes(samples) == ()


def test_a_counter_of_any_range_begins_again_and_interference_does_not() -> None:
    counts = np.floor(np.mod(700.0 * MOTION, 1000.0))
    assert begins_again(counts)
    assert begins_again(1e-3 * counts)
    assert not begins_again(MOTION)
    assert not begins_again(_with(MOTION, 20.0, 40, 900))
    assert not begins_again(_with(MOTION, float(np.min(MOTION)), int(np.argmax(MOTION))))
    assert not begins_again(MOTION + 20.0 * (T > 4.0))


def test_an_angle_within_a_turn_is_wrapped_either_way_it_is_counted() -> None:
    angle = 20.0 * np.sin(0.7 * T)
    assert is_wrapped(np.mod(angle, TURN), TURN)
    assert is_wrapped(np.mod(angle + np.pi, TURN) - np.pi, TURN)
    assert not is_wrapped(angle, TURN)
    assert not is_wrapped(np.mod(angle, TURN), 360.0)


@pytest.mark.parametrize(
    "samples",
    [
        np.where(T % 2.0 < 1.0, 0.0, TURN),
        np.where(T % 0.01 < 0.005, 0.1, 0.1 + TURN) + 0.0 * T,
        0.5 * TURN * np.sin(3.0 * T),
        np.random.default_rng(1).uniform(0.0, TURN, 8000),
    ],
    ids=["command of a turn", "square wave", "half a turn", "noise"],
)
def test_what_steps_without_moving_on_is_not_wrapped(samples: NDArray[np.float64]) -> None:
    assert not is_wrapped(samples, TURN)


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_a_counter_goes_by_its_power_of_two(bits: int) -> None:
    count = np.round(3.0 * 2.0**bits * np.sin(0.5 * T))
    assert wrapping_counter(np.mod(count, 2.0**bits)) == 2.0**bits
    half = 2.0 ** (bits - 1)
    assert wrapping_counter(np.mod(count + half, 2.0**bits) - half) == 2.0**bits
    assert wrapping_counter(count) is None


def test_a_command_of_two_levels_is_no_counter() -> None:
    assert wrapping_counter(np.where(T % 0.02 < 0.01, 0.0, 255.0)) is None


@pytest.mark.parametrize("rows", [2, 3, 10])
def test_a_held_reading_has_its_own_rows(rows: int) -> None:
    slow = held(MOTION[np.arange(T.size) // rows * rows])
    assert slow is not None
    assert slow.rows == rows
    assert slow.fresh[:3].tolist() == [0, rows, 2 * rows]


def test_a_reading_of_a_clock_of_its_own_is_held_too() -> None:
    places = np.floor(np.floor(np.arange(T.size) / 16.6) * 16.6).astype(int)
    slow = held(MOTION[places])
    assert slow is not None
    assert slow.rows in (16, 17)
    np.testing.assert_array_equal(slow.fresh, np.flatnonzero(np.diff(MOTION[places])) + 1)


@pytest.mark.parametrize(
    "samples",
    [
        MOTION,
        np.round(MOTION / 0.05) * 0.05,
        np.where(T % 0.1 < 0.05, 1.0, -1.0) * (T % 2.0 > 1.0),
        np.maximum(MOTION, 0.0),
        np.zeros(8000),
    ],
    ids=["motion", "encoder", "bursts", "saturated", "constant"],
)
def test_rounding_and_rest_are_not_held(samples: NDArray[np.float64]) -> None:
    assert held(samples) is None
