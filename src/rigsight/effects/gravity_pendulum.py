"""Gravity pendulum: the restoring torque of gravity follows the sine of the angle, not the angle.

Equation
--------
``torque = k_g (sin x - x)``, so that with the linear spring ``(k - k_g) x + k_g sin x`` restores

k_g: weight times distance of the center of mass from the axis; the effect vanishes at 0. k stays the whole stiffness at rest.

Applies to anything that hangs (or, with negative k_g, stands) and turns through large angles [rad]. At small angles it cannot
be told from a softening cubic spring with k_3 = -k_g / 6. Weights of more than ten times the whole stiffness are not searched:
weight and spring would have to cancel to a tenth, which makes every hardening spring a weight that stands.

Signature: softer at large amplitude; odd harmonics; no losses.

References: A. H. Nayfeh and D. T. Mook, *Nonlinear Oscillations* (Wiley 1979), chapter 2.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature, Start
from rigsight.effects.kinds import signed
from rigsight.effects.symbols import k, x

k_g, k_3 = sp.symbols("k_g k_3", real=True)

GRAVITY_PENDULUM = Effect(
    name="gravity_pendulum",
    place=Place.DYNAMICS,
    family=Family.GRAVITY,
    summary="Gravity restores with the sine of the angle.",
    parameters=(
        signed(
            "k_g",
            "weight times lever arm",
            "force x^-1",
            lower=-1e12,
            upper=1e12,
            starts=(1.0,),
            search=(-10.0, 10.0),
        ),
    ),
    energy=Energy.CONSERVATIVE,
    signature=Signature(gain_trend=GainTrend.RISES),
    torque=k_g * (sp.sin(x) - x),
    starts=(
        Start({"k_g": -6 * k_3}, parent="cubic_stiffness"),
        Start({"k_g": k}),
        Start({"k_g": -k}),
    ),
)
