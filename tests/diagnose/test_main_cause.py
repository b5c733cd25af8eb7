"""A main cause takes the larger part of the gap in every stretch of the records, and nothing as good acts elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.main_cause import main_cause
from rigsight.rigs import AXIS

N = 4000


@pytest.fixture
def cause(scored):
    def of(left: np.ndarray, tied: tuple[str, ...] = ()):
        rng = np.random.default_rng(0)
        linear = scored((), residuals=10.0 * rng.standard_normal(N))
        best = scored(("coulomb_friction",), residuals=left)
        rivals = [scored((name,), residuals=left) for name in tied]
        return main_cause(AXIS, linear, best, rivals, np.ones(1), np.random.default_rng(1))

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
    assert found.share > 0.5
    assert not found.clear


def test_only_what_acts_elsewhere_contradicts(cause) -> None:
    left = 3.0 * np.random.default_rng(2).standard_normal(N)
    assert cause(left, ("quadratic_damping",)).clear
    found = cause(left, ("actuator_lag",))
    assert not found.clear
    assert [model.names for model in found.contradicted_by] == [("actuator_lag",)]
