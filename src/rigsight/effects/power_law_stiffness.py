"""Power-law stiffness: a second spring in parallel whose force grows with a power of the deflection.

Equation
--------
``resisting torque = k_p x (|x| / x_r)^(n - 1)`` about the rest position

===  ===========================================================================================================
k_p  stiffness of the power law at the deflection x_r, force over deflection; the effect vanishes at 0
n    power: 3 is cubic stiffness, 1.5 the contact of a ball
x_r  deflection at which k_p holds; a convention, by default the size of the motion in the records
===  ===========================================================================================================

Applies to contacts that grow under load, wire ropes, harmonic drives and springs that bend over stops. Where the power is 3 it is
cubic stiffness; a sharp change of slope is an end stop or free play.

Signature: stiffer (softer) with amplitude, by a power other than the square; odd harmonics; no loss.

References: K. L. Johnson, *Contact Mechanics* (Cambridge 1985), chapter 4, for the power 1.5.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature, Start
from rigsight.effects.kinds import signed
from rigsight.effects.symbols import drive_size, x, x_size
from rigsight.parameters import Parameter

k_p, n, x_r, k_3 = sp.symbols("k_p n x_r k_3", real=True)

POWER_LAW_STIFFNESS = Effect(
    name="power_law_stiffness",
    place=Place.DYNAMICS,
    family=Family.SPRING_LAW,
    summary="A force parallel to the spring grows with a power of the deflection.",
    parameters=(
        signed(
            "k_p",
            "stiffness of the power law at x_r",
            "force x^-1",
            lower=-1e18,
            upper=1e30,
            starts=(0.5, 1.0),
            search=(-0.5, 1e3),
        ),
        Parameter("n", "power", "", lower=1.0, upper=20.0, starts=(1.5, 2.0), search=(1.2, 8.0)),
        Parameter(
            "x_r",
            "deflection at which k_p holds, a convention",
            "x",
            lower=1e-12,
            upper=1e12,
            default=1.0,
            starts=(1.0,),
            search=(1e-3, 1e3),
            fitted=False,
        ),
    ),
    energy=Energy.CONSERVATIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    torque=k_p * x * sp.Abs(x) ** (n - 1) * x_r ** (1 - n),
    starts=(
        Start({"k_p": 0.5 * drive_size / x_size, "n": sp.Float(1.6), "x_r": x_size}),
        Start({"k_p": k_3 * x_size**2, "n": sp.Integer(3), "x_r": x_size}, parent="cubic_stiffness"),
    ),
)
