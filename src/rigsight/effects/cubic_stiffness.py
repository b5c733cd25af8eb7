"""Cubic stiffness (Duffing).

Equation
--------
``resisting torque = k_3 x^3`` about the rest position.

k_3: cubic stiffness [force per displacement cubed], positive for hardening; the effect vanishes at 0.

Applies to large deflections, clamped beams and leaf springs. A spring with a sharp change of slope is an end stop or free
play instead.

Signature: the resonance rises (hardening) or falls (softening) with amplitude; odd harmonics; no loss.

References: I. Kovacic and M. J. Brennan, *The Duffing Equation* (Wiley 2011).
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import signed
from rigsight.effects.symbols import x

k_3 = sp.Symbol("k_3", real=True)

CUBIC_STIFFNESS = Effect(
    name="cubic_stiffness",
    place=Place.DYNAMICS,
    family=Family.SPRING_LAW,
    summary="The spring hardens (or softens) with the cube of the deflection.",
    parameters=(
        signed(
            "k_3",
            "cubic stiffness",
            "force x^-3",
            lower=-1e18,
            upper=1e30,
            starts=(0.3, -0.1),
            search=(-0.5, 1e3),
        ),
    ),
    energy=Energy.CONSERVATIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    torque=k_3 * x**3,
)
