"""Units and characteristic scales of products of powers, written once as ``"force x^-3"``.

A rig of several joints has a force and a motion at each: ``"force@shaft x@shaft^-3"``. The size of a number that is no product of
powers of these (a parameter, a coordinate, a state of such a rig) is a base quantity of its own, ``"size@J_m"``.
"""

from __future__ import annotations

from collections.abc import Mapping

DIMENSIONLESS = "1"
INPUT_UNIT = "input"
"""Unit of a signal that is measured in whatever the drive takes."""


def parse_dimension(dimension: str) -> dict[str, int]:
    """Return base quantity -> exponent of a text like ``"force time^2 x^-1"``.

    ``""`` is dimensionless.
    """
    exponents: dict[str, int] = {}
    for factor in dimension.split():
        base, _, exponent = factor.partition("^")
        exponents[base] = exponents.get(base, 0) + int(exponent or 1)
    return exponents


def unit_text(dimension: str, units: Mapping[str, str]) -> str:
    """Return the unit of a dimension, e.g. ``"N m/rad^3"`` for ``"force x^-3"``."""
    above: list[str] = []
    below: list[str] = []
    for base, exponent in parse_dimension(dimension).items():
        unit = units[base]
        if unit == DIMENSIONLESS or exponent == 0:
            continue
        power = abs(exponent)
        grouped = f"({unit})" if power > 1 and " " in unit else unit
        (above if exponent > 0 else below).append(grouped if power == 1 else f"{grouped}^{power}")
    if not below:
        return " ".join(above) or DIMENSIONLESS
    denominator = below[0] if len(below) == 1 and " " not in below[0] else f"({' '.join(below)})"
    return f"{' '.join(above) or '1'}/{denominator}"


def behind(unit: str) -> str:
    """Return a unit as it follows a number, with a space; nothing for a dimensionless one and for what a drive takes."""
    return "" if unit in ("", DIMENSIONLESS, INPUT_UNIT) else f" {unit}"


def at_place(dimension: str, place: str) -> str:
    """Return a dimension whose base quantities are those at a place: ``"force@shaft x@shaft^-1"``."""
    return " ".join(
        f"{base}@{place}^{exponent}" if exponent != 1 else f"{base}@{place}"
        for base, exponent in parse_dimension(dimension).items()
    )


def size_of(name: str) -> str:
    """Return the dimension of a number whose size is known by its name alone, see `at_place`."""
    return f"size@{name}"


def matters_at(name: str) -> str:
    """Return the key of the size at which a number matters as much as the largest part of an equation."""
    return f"matters@{name}"


def characteristic_value(dimension: str, scales: Mapping[str, float]) -> float:
    """Return the size that a quantity of this dimension naturally has in a record."""
    value = 1.0
    for base, exponent in parse_dimension(dimension).items():
        value *= float(scales[base]) ** exponent
    return value
