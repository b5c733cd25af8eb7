"""Quadratic (drag) damping.

Equation
--------
``resisting torque = c_2 |x'| x'``

c_2: drag coefficient [force per velocity squared]; the effect vanishes at 0.

Applies to air and fluid drag and to orifice dampers at speed.

Signature: the resonance is damped more at large amplitude, its frequency stays; odd harmonics near resonance.

References: K. Worden and G. R. Tomlinson, *Nonlinearity in Structural Dynamics* (IoP 2001), section 2.2.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import amount
from rigsight.effects.symbols import v

c_2 = sp.Symbol("c_2", real=True)

QUADRATIC_DAMPING = Effect(
    name="quadratic_damping",
    place=Place.DYNAMICS,
    family=Family.DAMPING_LAW,
    summary="Damping that grows with the square of the speed (fluid drag).",
    parameters=(
        amount("c_2", "drag coefficient", "force time^2 x^-2", starts=(0.1, 1.0), search=(0.0, 1e3)),
    ),
    energy=Energy.DISSIPATIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    torque=c_2 * sp.Abs(v) * v,
)
