"""Which kinds of numbers do effects have? What a kind says of all its numbers stands here; a `Parameter` says all itself."""

from __future__ import annotations

from functools import partial
from typing import Any

from rigsight.parameters import Parameter

signed = partial(Parameter, null=0.0)
"""Of either sign; at 0 its effect vanishes."""
limit = partial(Parameter, upper=1e300, null=1e300)
"""Where something ends; its effect vanishes where that is beyond all that occurs."""

_LARGEST = {
    "": 1.0, "x": 1e9, "x^-1": 1e12, "time": 1e6, "time^-1": 1e12, "x time^-1": 1e12, "input": 1e300, "drive": 1e12,
    "force x^-1": 1e18, "force time x^-3": 1e18, "force time^2 x^-1": 1e12, "force time^2 x^-2": 1e15,
}  # fmt: skip
_LEAST = {"x": 1e-12, "x^-1": 1e-9, "time": 1e-9, "time^-1": 1e-9, "x time^-1": 1e-12}
"""Ends of the range of a number by its dimension, where the effect gives none: beyond all that occurs."""


def amount(name: str, description: str, dimension: str, **more: Any) -> Parameter:
    """Return a number that is never negative; at 0 its effect vanishes."""
    own = {"lower": 0.0, "upper": _LARGEST[dimension], "null": 0.0}
    return Parameter(name, description, dimension, **own | more)


def scale(name: str, description: str, dimension: str, **more: Any) -> Parameter:
    """Return a positive size, searched over decades, at no value of which its effect vanishes."""
    own = {"lower": _LEAST.get(dimension), "upper": _LARGEST[dimension], "logarithmic": True}
    return Parameter(name, description, dimension, **own | more)
