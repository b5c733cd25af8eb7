"""Inertia: a mass that moves with an element whose motion is prescribed.

Equation
--------
``resisting torque = m_e x''``

m_e: inertia that moves with the element; the effect vanishes at 0.

Applies to what a bench accelerates between its load cell and the element: a fixture, a piston, half of a bellows. A rig that
moves freely has its own inertia among its parameters. The acceleration is that of the smoothed motion: noise of the displacement
grows in it with the square of the frequency.

Signature: stiffness that falls with the square of the frequency, at every amplitude; no loss.

References: D. J. Ewins, *Modal Testing* (Research Studies Press 2000), on mass cancellation.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import amount
from rigsight.effects.symbols import acceleration

m_e = sp.Symbol("m_e", real=True)

INERTIA = Effect(
    name="inertia",
    place=Place.DYNAMICS,
    family=Family.INERTIA,
    summary="A mass moves with the element, and its inertia force is part of the measured force.",
    parameters=(
        amount(
            "m_e",
            "inertia that moves with the element",
            "force time^2 x^-1",
            starts=(0.1, 0.5),
            search=(0.0, 10.0),
        ),
    ),
    energy=Energy.CONSERVATIVE,
    signature=Signature(gain_trend=GainTrend.STEADY),
    torque=m_e * acceleration,
)
