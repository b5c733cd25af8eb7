"""Result of a calibration of hysteresis."""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.identify.fit.fit_result import FitResult
from rigsight.identify.hysteresis.derived import DerivedQuantities

RELEASE_GAIN = 1.01
"""Factor by which releasing a special value (an exponent of 1) must lower the cost for other starts to be tried."""
BEYOND = 2.0
"""Factor of the special value at which the other start lies."""


@dataclass(frozen=True)
class Minimum:
    """One place where the refinement of a search ended.

    Attributes
    ----------
    values
        Value of every parameter.
    cost
        Mean squared weighted residual there.
    """

    values: dict[str, float]
    cost: float


@dataclass(frozen=True, eq=False)
class Calibration:
    """Hysteresis parameters with what follows from them.

    Attributes
    ----------
    fit
        Values, covariance and residuals.
    derived
        Saturation, pair and loop areas, with intervals.
    minima
        Where the refinements of the search's ends, and of the effects' own starts, arrived, best first, before special values
        were released: several of like cost say that the data allow several sets.
    n_simulated
        Parameter sets that the search simulated.
    """

    fit: FitResult
    derived: DerivedQuantities
    minima: tuple[Minimum, ...]
    n_simulated: int

    @property
    def values(self) -> dict[str, float]:
        """Every parameter by name."""
        return self.fit.values

    @property
    def standard_errors(self) -> dict[str, float]:
        """Of the fitted parameters by name."""
        return self.fit.standard_errors


def better(one: FitResult | None, other: FitResult) -> FitResult:
    """Return the fit with the lower cost."""
    return other if one is None or other.cost < one.cost else one
