"""Input delay (dead time).

Equation
--------
``drive = u(t - T_d)``

T_d: delay [s]; the effect vanishes at 0.

Applies to sampled controllers, buses and filters with linear phase. Without content well above resonance it looks like a
first-order lag.

Signature: phase that falls in proportion to frequency, magnitude untouched, at every amplitude.

References: L. Ljung, *System Identification* (Prentice Hall 1999), section 4.2.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.numbers import amount

T_d = sp.Symbol("T_d", real=True)

INPUT_DELAY = Effect(
    name="input_delay",
    place=Place.ACTUATOR,
    family=Family.DELAY_OR_LAG,
    summary="The drive acts later than commanded.",
    parameters=(amount("T_d", "dead time", "time", starts=(0.05, 0.2), search=(0.0, 3.0)),),
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.STEADY),
    delay=T_d,
)
