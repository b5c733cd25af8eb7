"""Scored models without a simulation, for rules that only look at held-out errors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.diagnose.workbench import Scored
from rigsight.effects import effect_named
from rigsight.identify import FitResult
from rigsight.rigs import AXIS
from rigsight.simulate import compose

MakeScored = Callable[..., Scored]


@pytest.fixture(scope="session")
def scored() -> MakeScored:
    """Make a model from its residuals in units of the noise floor, or from its excess alone."""

    def make(
        effects: tuple[str, ...] = (),
        residuals: NDArray[np.float64] | None = None,
        n_free: int = 4,
        excess: float | None = None,
    ) -> Scored:
        chosen = tuple(effect_named(name) for name in effects)
        columns = () if residuals is None else (np.asarray(residuals, dtype=np.float64)[:, None],)
        if excess is None:
            excess = float("inf") if residuals is None else float(np.sqrt(np.mean(residuals**2)))
        free = tuple(f"p{i}" for i in range(n_free))
        fit = FitResult(
            structure=compose(AXIS, chosen),
            success=residuals is not None,
            message="",
            values=dict.fromkeys(free, 1.0),
            standard_errors=dict.fromkeys(free, 0.1),
            initial_states=(),
            cost=excess**2,
            n_samples=1,
            n_evaluations=1,
            free=free,
            covariance=np.eye(n_free),
            residuals=columns,
        )
        return Scored(chosen, fit, columns, (), excess)

    return make
