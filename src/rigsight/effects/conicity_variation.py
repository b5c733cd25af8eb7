"""Conicity variation: the wheel profile steepens away from the center.

Equation
--------
``y' = v c_y (psi - (y - y_off) (1 + ((y - y_off) / y_n)^2) / (2 l_0))``

y_n: lateral displacement at which the restoring part has doubled; the effect vanishes as y_n grows without bound.

Applies to worn or curved wheel profiles. Does not describe a contact that saturates.

Signature: y is reduced at large displacement, most at low frequency; odd harmonics in y alone.

References: A. H. Wickens, *Fundamentals of Rail Vehicle Dynamics* (Swets & Zeitlinger 2003), on equivalent conicity.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import limit
from rigsight.effects.symbols import creep_gain, creepage, lateral_displacement, lateral_feedback

y_n = sp.Symbol("y_n", real=True)

CONICITY_VARIATION = Effect(
    name="conicity_variation",
    place=Place.LATERAL_DYNAMICS,
    family=Family.CONTACT,
    summary="The wheel profile steepens away from the center, so that the restoring effect on the axle grows with displacement.",
    parameters=(
        limit(
            "y_n",
            "displacement at which the restoring part has doubled",
            "length",
            lower=1e-12,
            starts=(2.0, 0.7),
            search=(0.05, 100.0),
            logarithmic=True,
        ),
    ),
    energy=Energy.DISSIPATIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    lateral=creep_gain
    * (creepage - lateral_displacement * (lateral_displacement / y_n) ** 2 * lateral_feedback),
)
