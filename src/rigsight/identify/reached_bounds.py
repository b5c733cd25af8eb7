"""Which parameters does a fit press against a bound, and which values do the records ask for?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from rigsight.identify.fit.covariance import LEVEL
from rigsight.identify.information import Information

_STOPPED = 0.1
"""Distance to the bound over the step that is asked for: a search that could still move would not stop before most of it."""


@dataclass(frozen=True)
class ReachedBound:
    """A parameter at a bound that the records ask it to pass."""

    # The parameter.
    name: str
    unit: str
    # ``"lower"`` or ``"upper"``, and its value.
    side: str
    bound: float
    # Value that the records ask for, by one step without the bound, and its standard error; a rough value,
    # because the other parameters are those beside the bound.
    asked: float
    std: float

    @property
    def sentence(self) -> str:
        """What was found, and what it may mean."""
        unit = "" if self.unit in ("", "1") else f" {self.unit}"
        sign = f"the sign of {self.name} or of a signal is wrong, " if self.bound == 0.0 else ""
        return (
            f"{self.name} stops at its {self.side} bound of {self.bound:.3g}{unit}; the records ask for about "
            f"{self.asked:.2g} +/- {self.std:.1g}{unit}. Either {sign}the equations lack an effect or are wrong "
            f"(see 'rigsight diagnose'), or the rig file must allow such values. The other values hold only beside this bound."
        )


def reached_bounds(found: Information, standard_errors: Mapping[str, float]) -> tuple[ReachedBound, ...]:
    """Return the parameters that stand at a bound and would pass it significantly.

    A parameter whose interval contains the bound, such as a damping that is zero within its error, is not among them.
    """
    width = float(norm.ppf(0.5 + 0.5 * LEVEL))
    reached = []
    for index, name in enumerate(found.names):
        value, asked, std = found.values[index], found.asked[index], standard_errors.get(name, np.inf)
        for side, bound in (("lower", found.lower[index]), ("upper", found.upper[index])):
            outward = -1.0 if side == "lower" else 1.0
            beyond = outward * (asked - bound)
            stopped = outward * (bound - value) <= _STOPPED * abs(asked - value)
            if np.isfinite(bound) and stopped and beyond > width * std:
                reached.append(ReachedBound(name, found.units[index], side, float(bound), float(asked), std))
    return tuple(reached)
