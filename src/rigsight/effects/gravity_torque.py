"""Gravity torque: a weight off the axis of a joint without a spring.

Equation
--------
``resisting torque = G_s sin(position) + G_c cos(position)``

===  =====================================================================================================
G_s  weight times the distance of the center of mass below the axis, where the sensor of the angle reads 0
G_c  weight times its distance beside the axis there; the effect vanishes where both are 0
===  =====================================================================================================

Applies to joints of arms with a payload or a link that the simulation weighs wrongly or not at all, whatever direction their
zero has, and to unbalanced wheels. Beside a spring, of which it takes a part, gravity is the effect `gravity_pendulum`.

Signature: one period per turn; no losses; even harmonics where the zero of the angle is not below the axis.

References: J. J. Craig, *Introduction to Robotics* (Pearson 2005), section 6.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import signed
from rigsight.effects.symbols import position

G_s, G_c = sp.symbols("G_s G_c", real=True)

GRAVITY_TORQUE = Effect(
    name="gravity_torque",
    place=Place.DYNAMICS,
    family=Family.GRAVITY,
    summary="Gravity pulls with the sine of the angle, from any zero of the sensor.",
    parameters=(
        signed(
            "G_s",
            "weight times lever arm, largest a quarter turn from the origin",
            "drive",
            lower=-1e15,
            upper=1e15,
            starts=(0.3, -0.3),
            search=(-10.0, 10.0),
        ),
        signed(
            "G_c",
            "weight times lever arm, largest at the origin",
            "drive",
            lower=-1e15,
            upper=1e15,
            starts=(0.1, -0.1),
            search=(-10.0, 10.0),
        ),
    ),
    energy=Energy.CONSERVATIVE,
    signature=Signature(gain_trend=GainTrend.RISES, even_harmonics=True),
    torque=G_s * sp.sin(position) + G_c * sp.cos(position),
    turns_freely=True,
)
