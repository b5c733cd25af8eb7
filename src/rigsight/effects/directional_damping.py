"""Directional damping: a damper that differs between the two directions, up to a knee.

Equation
--------
``resisting torque = d_fwd min(x', v_k)`` while x' > 0, ``d_bwd max(x', -v_k)`` while x' < 0, beside the rig's damping

=====  ==========================================================================
d_fwd  additional damping while x' is positive [force per velocity]
d_bwd  additional damping while x' is negative [force per velocity]; vanishes with d_fwd
v_k    velocity of the knee, from which on the additional force stays as it is
=====  ==========================================================================

Applies to vehicle dampers (bump and rebound, whose blow-off valves open at the knee), throttles with a check valve, and pneumatic
cylinders. Where no motion is faster than the knee, only the difference d_fwd - d_bwd can be told from the damping of the rig.

Signature: the resonance is damped less at large amplitude, and the mean position shifts with the motion; even harmonics.

References: J. C. Dixon, *The Shock Absorber Handbook* (Wiley 2007), chapter 7, for damper characteristics.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.symbols import clamp, v
from rigsight.parameters import Parameter

d_fwd, d_bwd, v_k = sp.symbols("d_fwd d_bwd v_k", real=True)
_below_knee = clamp(v, v_k)

DIRECTIONAL_DAMPING = Effect(
    name="directional_damping",
    place=Place.DYNAMICS,
    family=Family.DAMPING_LAW,
    summary="Damping is larger in one direction than in the other, up to a knee.",
    parameters=(
        Parameter(
            "d_fwd",
            "additional damping while x' is positive",
            "force time x^-1",
            lower=0.0,
            upper=1e15,
            null=0.0,
            starts=(1.0, 0.2),
            search=(0.0, 1e3),
        ),
        Parameter(
            "d_bwd",
            "additional damping while x' is negative",
            "force time x^-1",
            lower=0.0,
            upper=1e15,
            null=0.0,
            starts=(0.2, 1.0),
            search=(0.0, 1e3),
        ),
        Parameter(
            "v_k",
            "velocity of the knee",
            "x time^-1",
            lower=1e-12,
            upper=1e12,
            starts=(0.1, 0.03),
            search=(1e-3, 3.0),
        ),
    ),
    energy=Energy.DISSIPATIVE,
    signature=Signature(gain_trend=GainTrend.RISES, even_harmonics=True),
    torque=(d_fwd + d_bwd) / 2 * _below_knee + (d_fwd - d_bwd) / 2 * sp.Abs(_below_knee),
)
