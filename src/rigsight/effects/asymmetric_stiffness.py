"""Asymmetric (quadratic) stiffness.

Equation
--------
``resisting torque = k_2 x^2`` about the rest position.

k_2: quadratic stiffness [force per displacement squared]; the effect vanishes at 0.

Applies to springs that are stiffer on one side and to symmetric hardening springs that operate off their center. Valid while
``|k_2 x| < k``; beyond that the spring pushes away from rest.

Signature: even harmonics and a mean that shifts with amplitude.

References: K. Worden and G. R. Tomlinson, *Nonlinearity in Structural Dynamics* (IoP 2001), section 2.2.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import signed
from rigsight.effects.symbols import x

k_2 = sp.Symbol("k_2", real=True)

ASYMMETRIC_STIFFNESS = Effect(
    name="asymmetric_stiffness",
    place=Place.DYNAMICS,
    family=Family.SPRING_LAW,
    summary="The spring is stiffer on one side than on the other.",
    parameters=(
        signed(
            "k_2",
            "quadratic stiffness",
            "force x^-2",
            lower=-1e24,
            upper=1e24,
            starts=(0.2, -0.2),
            search=(-1.0, 1.0),
        ),
    ),
    energy=Energy.CONSERVATIVE,
    signature=Signature(gain_trend=GainTrend.RISES, even_harmonics=True),
    torque=k_2 * x**2,
)
