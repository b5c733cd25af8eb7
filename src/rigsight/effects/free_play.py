"""Free play: the spring acts only on the part of the displacement beyond a dead zone.

Equation
--------
``spring deflection = x - g`` for x > g, ``x + g`` for x < -g, zero between.

g: half-width of the play; the effect vanishes at 0.

Applies to worn joints and loose couplings in series with the spring, without memory. Play that moves along with the motion is
backlash.

Signature: soft at small amplitude, stiffening towards the full stiffness; odd harmonics.

References: D. Tang, E. H. Dowell, AIAA J. 44 (2006), for free play in dynamic systems.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import amount
from rigsight.effects.symbols import beyond, x

g = sp.Symbol("g", real=True)

FREE_PLAY = Effect(
    name="free_play",
    place=Place.DYNAMICS,
    family=Family.PLAY_AND_STOPS,
    summary="The spring has a gap around its rest position in which it does not act.",
    parameters=(amount("g", "half-width of the play", "x", starts=(0.05, 0.3), search=(0.0, 2.0)),),
    energy=Energy.CONSERVATIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    deflection=beyond(x, g),
)
