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

from rigsight.effects.effect import Place
from rigsight.effects.kinds import amount, late

T_d = sp.Symbol("T_d", real=True)

INPUT_DELAY = late(
    name="input_delay",
    place=Place.ACTUATOR,
    summary="The drive acts later than commanded.",
    parameters=(amount("T_d", "dead time", "time", starts=(0.05, 0.2), search=(0.0, 3.0)),),
    delay=T_d,
)
