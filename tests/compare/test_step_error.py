"""The window and the error of a step, as the thesis takes them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from rigsight.compare import step_window
from rigsight.compare.response_error import stepping_input
from rigsight.errors import InputError
from rigsight.excitation import step
from rigsight.records import Record

DT = 5e-3


def record(u: np.ndarray) -> Record:
    return Record("step", DT, {"u": u}, {"u": "A"}, kind="step", hold="zoh")


def test_a_step_at_180_seconds_is_compared_from_180_to_184_seconds() -> None:
    made = record(step(DT * np.arange(40_000), 0.6, 180.0))
    window = step_window(made, "u")
    assert made.t[window.inside][[0, -1]] == pytest.approx([180.0, 184.0])
    assert made.t[window.before][[0, -1]] == pytest.approx([175.0, 180.0 - DT])


def test_the_error_is_that_of_the_motion_after_the_offset() -> None:
    window = step_window(record(step(DT * np.arange(4000), 0.6, 10.0)), "u")
    measured, simulated = np.full(4000, 3.0), np.full(4000, -1.0)
    assert window.error(measured, simulated) == 0.0
    simulated[2000:] += np.where(np.arange(2000) % 2 == 0, 0.3, -0.3)
    assert window.error(measured, simulated) == pytest.approx(0.3)


def test_what_happens_after_the_window_does_not_count() -> None:
    window = step_window(record(step(DT * np.arange(4000), 0.6, 10.0)), "u", seconds=2.0)
    late = np.where(np.arange(4000) > 2400, 5.0, 0.0)
    assert window.error(np.zeros(4000), late) == 0.0


def test_noise_alone_makes_the_floor() -> None:
    window = step_window(record(step(DT * np.arange(4000), 0.6, 10.0)), "u")
    rng = np.random.default_rng(3)
    errors = [window.error(rng.normal(scale=0.2, size=4000), np.zeros(4000)) for _ in range(200)]
    assert math.sqrt(np.mean(np.square(errors))) == pytest.approx(window.floor(0.2), rel=0.02)


def test_a_record_that_ends_early_is_compared_up_to_its_end() -> None:
    window = step_window(record(step(DT * np.arange(2200), 0.6, 10.0)), "u")
    assert window.inside == slice(2000, 2200)


@pytest.mark.parametrize(
    ("u", "reported"),
    [(np.ones(500), "constant"), (np.where(np.arange(500) < 1, 0.0, 1.0), "rest before the step")],
)
def test_a_step_without_offset_or_without_step_is_told(u: np.ndarray, reported: str) -> None:
    with pytest.raises(InputError, match=reported):
        step_window(record(u), "u")


def test_the_noise_of_an_input_that_is_held_is_no_step() -> None:
    rng = np.random.default_rng(0)
    held, stepped = 1.0 + 1e-3 * rng.standard_normal(2000), 1e-3 * rng.standard_normal(2000)
    late = np.zeros(2000)
    late[1500:] = 1.0
    stepped[1000:] += 1.0
    made = Record("step", DT, {"held": held, "stepped": stepped, "late": late}, {}, kind="step")
    for sources in itertools.permutations(("held", "stepped", "late")):
        assert stepping_input(made, sources) == "stepped"
    assert stepping_input(made, ("held", "late")) == "late"
    assert step_window(made, "stepped").inside.start == 1000


def test_without_any_step_the_first_input_that_moves_is_taken() -> None:
    made = Record("still", DT, {"a": np.ones(100), "b": np.linspace(0.0, 1.0, 100)}, {}, kind="step")
    assert stepping_input(made, ("a", "b")) == "b"
    assert stepping_input(made, ("a",)) == "a"
