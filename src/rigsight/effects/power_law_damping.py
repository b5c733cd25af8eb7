"""Power-law damping: a damper in parallel whose force grows with a power of the speed.

Equation
--------
``resisting torque = c_p x' (|x'| / v_r)^(n - 1)``

===  ===========================================================================================================
c_p  damping of the power law at the speed v_r, force over speed; the effect vanishes at 0
n    power: towards 0 dry friction, 1 viscous damping, 2 drag; below 1 digressive, above progressive
v_r  speed at which c_p holds; a convention, by default the size of the speed in the records
===  ===========================================================================================================

Below a thousandth of v_r the damper is viscous, so that a digressive one has a finite slope at rest.

Applies to orifice and valve dampers of vehicles and machines, and to fluid dampers of buildings (powers of 0.3 to 1).

Signature: the resonance is damped less at a large amplitude (digressive) or more (progressive), its frequency stays; no memory.

References: M. C. Constantinou and M. D. Symans, *Experimental and Analytical Investigation of Seismic Response of Structures with
Supplemental Fluid Viscous Dampers* (NCEER-92-0032, 1992), for powers below 1. J. C. Dixon, *The Shock Absorber Handbook* (Wiley
2007), chapter 6.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature, Start
from rigsight.effects.kinds import amount
from rigsight.effects.symbols import drive_size, v, v_size
from rigsight.parameters import Parameter

c_p, n, v_r, c_2 = sp.symbols("c_p n v_r c_2", real=True)

_VISCOUS = sp.Float(1e-3)

POWER_LAW_DAMPING = Effect(
    name="power_law_damping",
    place=Place.DYNAMICS,
    family=Family.DAMPING_LAW,
    summary="Damping grows with a power of the speed, less (digressive) or more (progressive) than viscous damping.",
    parameters=(
        amount(
            "c_p", "damping of the power law at v_r", "force time x^-1", starts=(0.3, 1.0), search=(0.0, 1e3)
        ),
        Parameter("n", "power", "", lower=0.0, upper=3.0, starts=(0.5, 1.6), search=(0.3, 3.0)),
        Parameter(
            "v_r",
            "speed at which c_p holds, a convention",
            "x time^-1",
            lower=1e-12,
            upper=1e12,
            default=1.0,
            starts=(1.0,),
            search=(1e-3, 1e3),
            fitted=False,
        ),
    ),
    energy=Energy.DISSIPATIVE,
    signature=Signature(gain_trend=GainTrend.RISES),
    torque=c_p * v * ((v / v_r) ** 2 + _VISCOUS**2) ** ((n - 1) / 2),
    starts=(
        Start({"c_p": 0.3 * drive_size / v_size, "n": sp.Float(0.5), "v_r": v_size}),
        Start({"c_p": 0.3 * drive_size / v_size, "n": sp.Float(1.6), "v_r": v_size}),
        Start({"c_p": c_2 * v_size, "n": sp.Integer(2), "v_r": v_size}, parent="quadratic_damping"),
    ),
)
