"""Backlash: play between displacement and spring that is carried along.

Equation
--------
``spring deflection w = x - z``,  ``z' = x'`` within ``-g <= z <= g`` (held at the ends)

g: half-width of the play; the effect vanishes at 0. w rests until x has crossed the play and then follows it.

Applies to gears, keyways and loose joints whose far side is held by friction, so that it stays where it was left. Play whose
far side returns by itself is free play.

Signature: at small amplitude the spring has no effect; at large amplitude it is softer, and damping is lower, because its torque
lags the motion and adds energy (a lightly damped rig hunts); odd harmonics; loops at any speed, equally wide at every amplitude.

References: M. A. Krasnosel'skii and A. V. Pokrovskii, *Systems with Hysteresis* (Springer 1989), the play operator;
M. Nordin and P.-O. Gutman, Automatica 38 (2002) 1633.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature, State
from rigsight.effects.kinds import amount
from rigsight.effects.symbols import v, x

g, z = sp.symbols("g z", real=True)

BACKLASH = Effect(
    name="backlash",
    place=Place.DYNAMICS,
    family=Family.PLAY_AND_STOPS,
    summary="There is play between the displacement and the spring; the play moves along with the motion.",
    parameters=(amount("g", "half-width of the play", "x", starts=(0.05, 0.3), search=(0.0, 1.0)),),
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    deflection=x - z,
    states=(State(z, v, "x", limit=g),),
)
