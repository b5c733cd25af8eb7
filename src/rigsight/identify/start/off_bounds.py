"""Start values at a bound moved inside: at a size of zero, the derivatives say little about where the minimum lies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rigsight.simulate import Structure
from rigsight.units import characteristic_value

_INSIDE = 0.1
"""Start of a parameter that declares none, in characteristic units: of a damping, a damping ratio of 0.05."""


def off_bounds(
    structure: Structure, values: Mapping[str, float], free: Sequence[str], scales: Mapping[str, float]
) -> dict[str, float] | None:
    """Return start values without free parameters at a bound of their range; None if there are none."""
    moved = {
        p.name: min(max(share * characteristic_value(p.dimension, scales), p.lower), p.upper)
        for p in structure.parameters
        if p.name in free and values[p.name] in (p.lower, p.upper)
        for share in (p.starts or (_INSIDE,))[:1]
    }
    return {**values, **moved} if moved else None
