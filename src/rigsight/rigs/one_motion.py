"""A rig of one motion and a state that follows it, in the form `m x'' + d x' + k x = gain u`?"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from rigsight.effects.symbols import derivative
from rigsight.rigs.parts import Coordinate, RateState


@dataclass(frozen=True)
class Motion:
    """The single degree of freedom of a rig with one joint, or the motion that is prescribed to it.

    ``inertia * x'' = drive_gain * u + bias - spring(x - rest) - damping * x' - effects``; without an inertia the motion is
    prescribed and the right-hand side's torques are the output.
    """

    # Symbols of the state (or of the prescribed motion).
    displacement: sp.Symbol
    velocity: sp.Symbol
    # Expressions of the rig's parameters and constants.
    stiffness: sp.Expr
    damping: sp.Expr
    drive_gain: sp.Expr
    rest: sp.Expr
    bias: sp.Expr
    inertia: sp.Expr | None  # expression, or None where the motion is prescribed


@dataclass(frozen=True)
class Follower:
    """A first-order state that follows the motion: ``y' = gain * creepage``."""

    symbol: sp.Symbol  # symbol of the state
    displacement: sp.Expr  # the state from its rest
    creepage: sp.Expr  # what drives it: the motion less what the displacement itself turns back
    gain: sp.Expr  # rate per creepage
    feedback: sp.Expr  # creepage that a unit of displacement takes away

    @property
    def static_gain(self) -> sp.Expr:
        """Displacement from rest at which a unit of the motion is all turned back."""
        return 1 / self.feedback


def follower_of(state: RateState, motion: Coordinate) -> Follower | None:
    """Return how a state follows the motion; None where its rate is not a sum of the two, each with a factor."""
    gain, back = derivative(state.rate, motion.symbol), derivative(state.rate, state.symbol)
    moving = {motion.symbol, motion.rate, state.symbol}
    if gain == 0 or back == 0 or (gain.free_symbols | back.free_symbols) & moving:
        return None
    creepage, feedback = sp.expand(state.rate / gain), -back / gain
    displacement = sp.simplify((motion.symbol - creepage) / feedback)
    return Follower(state.symbol, displacement, motion.symbol - displacement * feedback, gain, feedback)
