"""The numbers that one record alone would have: which steps towards them are taken."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rigsight.identify.fit import derivatives
from rigsight.identify.fit.derivatives import own_derivatives

RESIDUAL, SLOPES = np.array([1.0, 2.0, 2.0]), np.array([[1.0], [2.0], [2.1]])


@pytest.mark.parametrize("beyond", [np.inf, np.nan, 1e200])
def test_a_step_to_where_the_derivatives_diverge_is_not_taken(
    monkeypatch: pytest.MonkeyPatch, beyond: float
) -> None:
    """One lowers the error of the motion, but its derivatives there are no numbers, or their squares are none."""

    def sensitivities(theta: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        moved = bool(theta[0] != 0.0)
        return [(RESIDUAL + SLOPES @ theta, np.full_like(SLOPES, beyond) if moved else SLOPES)]

    coordinates = SimpleNamespace(lower=np.array([-9.0]), upper=np.array([9.0]))
    problem = SimpleNamespace(
        coordinates=coordinates, sensitivities=sensitivities, derivative_error=1e-6, n_free=1
    )
    monkeypatch.setattr(derivatives, "place_of_fit", lambda *_: (problem, np.zeros(1)))
    assert own_derivatives(None, SimpleNamespace(values={}), ["k"], 3, 1e-3) is None
