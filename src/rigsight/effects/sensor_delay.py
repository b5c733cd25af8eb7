"""Sensor delay: the displacement is measured with a delay.

Equation
--------
``measured(t) = x(t - T_s)``

T_s: dead time of the sensor; the effect vanishes at 0.

Applies to sensors that average, filter digitally or are polled. If no other measured signal depends on the displacement, it
cannot be distinguished from an input delay.

Signature: phase that falls in proportion to frequency, in the displacement alone; signals that depend on the displacement appear
early.

References: K. J. Astrom and B. Wittenmark, *Computer-Controlled Systems* (Prentice Hall 1997), on time delays.
"""

import sympy as sp

from rigsight.effects.effect import Place
from rigsight.effects.kinds import amount, late

T_s = sp.Symbol("T_s", real=True)

SENSOR_DELAY = late(
    name="sensor_delay",
    place=Place.SENSOR,
    summary="The displacement is measured with a delay.",
    parameters=(amount("T_s", "dead time", "time", starts=(0.05, 0.2), search=(0.0, 3.0)),),
    reading_delay=T_s,
)
