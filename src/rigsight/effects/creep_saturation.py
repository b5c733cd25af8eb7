"""Creep saturation: the lateral creep force cannot exceed what friction carries.

Equation
--------
``y' = v c_y s tanh(creepage / s)``,  ``creepage = psi - (y - y_off) / (2 l_0)``

s: creepage at which the contact saturates; the effect vanishes as s grows without bound.

Applies to rolling contact driven into sliding. Does not describe a contact whose conicity changes with position.

Signature: psi -> y loses gain at large amplitude; odd harmonics in y alone.

References: J. J. Kalker, *Three-Dimensional Elastic Bodies in Rolling Contact* (Kluwer 1990); the hyperbolic tangent is the
usual smooth form of the saturation.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import limit
from rigsight.effects.symbols import creep_gain, creepage

s = sp.Symbol("s", real=True)

CREEP_SATURATION = Effect(
    name="creep_saturation",
    place=Place.LATERAL_DYNAMICS,
    family=Family.CONTACT,
    summary="The rolling contact saturates: at large creepage the lateral rate grows less than the creepage.",
    parameters=(
        limit(
            "s",
            "creepage at saturation",
            "x",
            lower=1e-12,
            starts=(1.0, 0.3),
            search=(0.02, 100.0),
            logarithmic=True,
        ),
    ),
    energy=Energy.DISSIPATIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    lateral=creep_gain * s * sp.tanh(creepage / s),
)
