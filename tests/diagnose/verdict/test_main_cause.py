"""A main cause explains the larger part of the gap; what explains as much elsewhere is reported with it."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.verdict.judgement import main_cause
from rigsight.rigs import AXIS

N = 4000


@pytest.fixture
def cause(scored):
    def of(left: np.ndarray, tied: tuple[str, ...] = (), others_left: np.ndarray | None = None):
        rng = np.random.default_rng(0)
        reidentified = scored((), residuals=10.0 * rng.standard_normal(N))
        best = scored(("coulomb_friction",), residuals=left)
        rivals = [scored((name,), residuals=left if others_left is None else others_left) for name in tied]
        return main_cause(AXIS, reidentified, best, rivals, np.ones(1), np.random.default_rng(1))

    return of


def test_the_share_is_of_the_square_above_the_floor(cause) -> None:
    found = cause(5.0 * np.random.default_rng(2).standard_normal(N))
    assert found.share == pytest.approx((100.0 - 25.0) / 99.0, abs=0.03)
    assert 0.6 < found.at_least < found.share
    assert found.clear


def test_half_is_not_the_larger_part(cause) -> None:
    assert not cause(7.2 * np.random.default_rng(2).standard_normal(N)).clear


def test_a_part_that_one_stretch_decides_is_not_sure(cause) -> None:
    left = np.random.default_rng(2).standard_normal(N)
    left[: N // 20] *= 28.0
    found = cause(left)
    assert found.at_least < 0.5 < found.share


@pytest.fixture
def halves() -> tuple[np.ndarray, np.ndarray]:
    """Return what is left by two models that each explain most of the gap, but the one in the other half of the time."""
    gap, noise = (
        10.0 * np.random.default_rng(0).standard_normal(N),
        np.random.default_rng(2).standard_normal(N),
    )
    first = np.arange(N) % 100 < 50
    return np.where(first, noise, 0.62 * gap), np.where(first, 0.62 * gap, noise)


def test_only_what_acts_elsewhere_and_takes_another_part_contradicts(cause, halves) -> None:
    left, others_left = halves
    assert cause(left, ("quadratic_damping",), others_left).clear
    found = cause(left, ("actuator_lag",), others_left)
    assert [model.names for model in found.contradicted_by] == [("actuator_lag",)]
    assert not found.equalled_by


def test_what_takes_the_same_part_from_elsewhere_leaves_the_place_open(cause) -> None:
    left = 3.0 * np.random.default_rng(2).standard_normal(N)
    found = cause(left, ("actuator_lag",))
    assert [model.names for model in found.equalled_by] == [("actuator_lag",)]
    assert found.clear
