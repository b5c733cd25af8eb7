"""True records exceed the limit of their gap as rarely as asked, whether records differ or not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from rigsight.compare import KnownGap, UsualGap
from rigsight.identify import mean_square_freedom

FREEDOM = 60.0


def drawn(rng: np.random.Generator, between: float, n: int) -> np.ndarray:
    """Return RMS of residuals whose mean square differs between records by this standard deviation of its logarithm."""
    return np.sqrt(rng.chisquare(FREEDOM, n) / FREEDOM * np.exp(between * rng.standard_normal(n)))


def known(sizes: np.ndarray, freedom: float = FREEDOM) -> UsualGap:
    found = UsualGap.of(
        [KnownGap(str(i), "x", float(s), freedom, 10.0, 50.0) for i, s in enumerate(sizes)], "x"
    )
    assert found is not None
    return found


@pytest.mark.parametrize(("between", "n_known"), [(0.0, 5), (0.4, 5), (0.4, 3), (0.0, 1)])
def test_a_true_record_exceeds_its_limit_as_rarely_as_asked(between: float, n_known: int) -> None:
    rng = np.random.default_rng(4)
    exceeded = 0
    for _ in range(1500):
        usual = known(drawn(rng, between, n_known))
        gap = float(drawn(rng, between, 1)[0])
        exceeded += gap > usual.limit(10.0, 0.05)
        assert (usual.p_value(gap, 10.0) < 0.05) == (gap > usual.limit(10.0, 0.05))
    # Without a difference between records Student's distribution is wider than it must be.
    assert (0.0 if between == 0.0 else 0.03) < exceeded / 1500 < 0.07


def test_shorter_records_scatter_more() -> None:
    usual = known(np.array([1.0, 1.02, 0.98, 1.01, 0.99]))
    assert usual.limit(1.0, 0.05) > usual.limit(10.0, 0.05) > usual.center == pytest.approx(1.0, rel=0.02)


def test_a_perfect_model_has_the_accuracy_of_simulations_as_its_gap() -> None:
    assert known(np.zeros(3)).center == pytest.approx(50e-4, rel=0.02)


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_a_colored_residual_has_as_many_degrees_of_freedom_as_its_mean_square_shows(pole: float) -> None:
    rng = np.random.default_rng(0)
    series = lfilter([1.0], [1.0, -pole], rng.standard_normal((400, 2500)), axis=1)[:, 500:]
    squares = np.mean(series**2, axis=1)
    counted = 2.0 * np.mean(squares) ** 2 / np.var(squares)
    found = np.mean([mean_square_freedom(row) for row in series[:50]])
    assert found == pytest.approx(counted, rel=0.2)
