"""Text of parameter combinations, lists of them and relative errors."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

_LARGEST_POWER = 3
ONE = 0.03
"""Relative distance up to which a factor between values of the same unit counts as one (and is left out), and a power as a small
fraction."""


def product_text(factors: Sequence[tuple[str, int]]) -> str:
    """Return a product of powers, as in ``k*m^2/d``."""
    above = [_power(text, power) for text, power in factors if power > 0]
    below = [_power(text, -power) for text, power in factors if power < 0]
    return "*".join(above) + "".join(f"/{text}" for text in below)


def sum_text(first: str, weight: float, second: str, same_unit: bool) -> str:
    """Return ``first + weight second``; the weight is left out if it is one and both have the same unit."""
    factor = "" if same_unit and abs(abs(weight) - 1.0) < ONE else f"{abs(weight):.3g} "
    return f"{first} {'-' if weight < 0.0 else '+'} {factor}{second}"


def small_fraction(ratio: float) -> Fraction | None:
    """Return the fraction of small integers to which a ratio is close, None if there is none; a step along it then decides."""
    nearest = Fraction(ratio).limit_denominator(_LARGEST_POWER)
    close = nearest != 0 and abs(float(nearest) - ratio) <= ONE * abs(ratio)
    return nearest if close and abs(nearest.numerator) <= _LARGEST_POWER else None


def listed(names: Sequence[str]) -> str:
    """Return names as in ``a, b and c``."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def percent(error: float) -> str:
    """Return a relative error in percent, or as a multiple of the value if it is large."""
    return f"{100.0 * error:.2g} %" if error < 10.0 else f"{error:.2g} times its value"


def _power(text: str, power: int) -> str:
    whole = f"({text})" if any(sign in text for sign in " */") else text
    return whole if power == 1 else f"{whole}^{power}"
