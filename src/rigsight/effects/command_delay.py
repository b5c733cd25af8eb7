"""Delay of the command (of a bus, or of the controller's cycle).

Equation
--------
The law reads ``command(t - T_m)``; its readings are in time.

T_m: delay [s]; the effect vanishes at 0.

Applies to goals that come over a bus. A delay of the drive delays the readings as well and takes damping from the loop. Where
the law is the force of a position drive, a delay of the drive is the same, and this effect is not offered.

Signature: phase that falls in proportion to frequency, at every amplitude, without a change of the damping of the loop.

References: L. Ljung, *System Identification* (Prentice Hall 1999), section 4.2.
"""

import sympy as sp

from rigsight.effects.effect import Place
from rigsight.effects.kinds import amount, late

T_m = sp.Symbol("T_m", real=True)

COMMAND_DELAY = late(
    name="command_delay",
    place=Place.CONTROLLER,
    summary="The controller receives its command late.",
    parameters=(amount("T_m", "delay", "time", starts=(0.05, 0.2), search=(0.0, 3.0)),),
    command_delay=T_m,
)
