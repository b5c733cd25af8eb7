"""Rectified sensor: it shows the magnitude of what it reads.

Equation
--------
``reading = (1 - r) y + r |y|``

r: share of the rectified reading; the effect vanishes at 0, and a sensor that shows the magnitude alone has 1.

Applies to pulse counters and tachometers without a direction, RMS and power meters, and to one of two channels of an incremental
encoder that is lost.

Signature: the reading never changes its sign; even harmonics, and a mean that grows with the motion.

References: T. Wigren and M. Schoukens, "Coupled electric drives data set and reference models" (Uppsala University 2017), for a
pulse counter that is insensitive to the direction.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import amount
from rigsight.effects.symbols import reading

r = sp.Symbol("r", real=True)

RECTIFIED_SENSOR = Effect(
    name="rectified_sensor",
    place=Place.SENSOR,
    family=Family.SENSOR,
    summary="The sensor shows the magnitude and not the sign.",
    parameters=(amount("r", "share of the rectified reading", "", starts=(0.9, 0.5), search=(0.0, 1.0)),),
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.STEADY, even_harmonics=True),
    measured=(1 - r) * reading + r * sp.Abs(reading),
)
