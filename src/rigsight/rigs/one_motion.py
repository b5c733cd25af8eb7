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

    Attributes
    ----------
    displacement, velocity
        Symbols of the state (or of the prescribed motion).
    stiffness, damping, drive_gain, rest, bias
        Expressions of the rig's parameters and constants.
    inertia
        Expression, or None where the motion is prescribed.
    """

    displacement: sp.Symbol
    velocity: sp.Symbol
    stiffness: sp.Expr
    damping: sp.Expr
    drive_gain: sp.Expr
    rest: sp.Expr
    bias: sp.Expr
    inertia: sp.Expr | None


@dataclass(frozen=True)
class Follower:
    """A first-order state that follows the motion: ``y' = gain * creepage``.

    Attributes
    ----------
    symbol
        Symbol of the state.
    displacement
        The state from its rest.
    creepage
        What drives it: the motion less what the displacement itself turns back.
    gain
        Rate per creepage.
    feedback
        Creepage that a unit of displacement takes away.
    """

    symbol: sp.Symbol
    displacement: sp.Expr
    creepage: sp.Expr
    gain: sp.Expr
    feedback: sp.Expr

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
