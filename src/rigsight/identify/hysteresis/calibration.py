"""Result of a calibration of hysteresis."""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.identify.fit.fit_result import FitResult
from rigsight.identify.hysteresis.derived import DerivedQuantities

RELEASE_GAIN = 1.01
"""Factor by which releasing a special value (an exponent of 1) must lower the cost for other starts to be tried."""
BEYOND = 2.0
"""Factor of the special value that gives the other start."""


@dataclass(frozen=True)
class Minimum:
    """One local minimum, at which the refinement of a search ended."""

    values: dict[str, float]  # of every parameter
    cost: float  # mean squared weighted residual


@dataclass(frozen=True, eq=False)
class Calibration:
    """Hysteresis parameters, with quantities derived from them."""

    fit: FitResult  # values, covariance and residuals
    derived: DerivedQuantities  # saturation, pair and loop areas, with intervals
    # Local minima reached from the ends of the search and from the effects' own starts, best first, before special values were
    # released. Several of similar cost show that the data allow several sets.
    minima: tuple[Minimum, ...]
    n_simulated: int  # number of parameter sets that the search simulated

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
