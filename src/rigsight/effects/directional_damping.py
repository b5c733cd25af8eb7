"""Directional damping: a damper that is stiffer in one direction than in the other, up to a knee.

Equation
--------
``resisting torque = d_a min(|x'|, v_k)``, beside the damping of the rig

===  ==============================================================================================
d_a  half the difference of the damping of the two directions [force per velocity]; vanishes at 0
v_k  velocity of the knee, from which on the two directions differ by a constant force
===  ==============================================================================================

The damping of the rig is the mean of both directions: below the knee it is d + d_a while x' is positive and d - d_a while it is
negative.

Applies to vehicle dampers (bump and rebound, whose valves open at the knee), throttles with a check valve, and pneumatic
cylinders.

Signature: the mean position shifts with the motion; even harmonics.

References: J. C. Dixon, *The Shock Absorber Handbook* (Wiley 2007), chapter 7, for damper characteristics.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import signed
from rigsight.effects.symbols import clamp, v
from rigsight.parameters import Parameter

d_a, v_k = sp.symbols("d_a v_k", real=True)

DIRECTIONAL_DAMPING = Effect(
    name="directional_damping",
    place=Place.DYNAMICS,
    family=Family.DAMPING_LAW,
    summary="Damping is larger in one direction than in the other, up to a knee.",
    parameters=(
        signed(
            "d_a",
            "half the difference of the damping of the two directions",
            "force time x^-1",
            lower=-1e15,
            upper=1e15,
            starts=(0.5, -0.5),
            search=(-1e3, 1e3),
        ),
        Parameter(
            "v_k",
            "velocity of the knee",
            "x time^-1",
            lower=1e-12,
            upper=1e12,
            starts=(0.1, 0.5),
            search=(2e-2, 3.0),
        ),
    ),
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.FALLS, even_harmonics=True),
    torque=d_a * sp.Abs(clamp(v, v_k)),
)
