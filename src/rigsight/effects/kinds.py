"""Which kinds of effects and of numbers are there? What a kind says of all of its own stands here.

An `Effect` or a `Parameter` that is of no kind says all itself.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.parameters import Parameter

_steady = Signature(gain_trend=GainTrend.STEADY)
dry_friction = partial(
    Effect, place=Place.DYNAMICS, family=Family.DRY_FRICTION, energy=Energy.DISSIPATIVE,
    signature=Signature(gain_trend=GainTrend.RISES),
)  # fmt: skip
"""Dissipates at a joint; small inputs move nothing."""
of_controller = partial(
    Effect, place=Place.CONTROLLER, family=Family.CONTROLLER, energy=Energy.ACTIVE, signature=_steady
)
"""Of the law of a drive; linear, unless its signature says otherwise."""
late = partial(Effect, family=Family.DELAY_OR_LAG, energy=Energy.ACTIVE, signature=_steady)
"""A signal arrives late, by a delay or a lag."""

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
