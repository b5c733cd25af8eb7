"""First-order lag of the actuator.

Equation
--------
``T_a u_a' + u_a = u``, the drive is u_a.

T_a: time constant [s]; the effect vanishes at 0.

Applies to motor inductance, valves and current controllers of finite bandwidth.

Signature: magnitude falls by a further 20 dB per decade above 1/T_a and the phase by up to 90 degrees, at every amplitude.

References: L. Ljung, *System Identification* (Prentice Hall 1999), section 4.2.
"""

import sympy as sp

from rigsight.effects.effect import Place, State
from rigsight.effects.kinds import amount, late
from rigsight.effects.symbols import u

T_a, u_a = sp.symbols("T_a u_a", real=True)

ACTUATOR_LAG = late(
    name="actuator_lag",
    place=Place.ACTUATOR,
    summary="The drive follows its command with a first-order lag.",
    parameters=(
        amount("T_a", "time constant", "time", starts=(0.05, 0.3), search=(1e-3, 10.0), logarithmic=True),
    ),
    drive=u_a,
    states=(State(u_a, (u - u_a) / T_a, "input"),),
)
