"""Dead zone of the input.

Equation
--------
``drive = u - u_0`` for u > u_0, ``u + u_0`` for u < -u_0, zero between.

u_0: half-width of the dead zone; the effect vanishes at 0.

Applies to valves with overlap and to drives with a threshold (static torque taken off the command).

Signature: gain at every frequency rises with amplitude; odd harmonics; inputs below the threshold do nothing.

References: H. K. Khalil, *Nonlinear Systems* (Prentice Hall 2002), section 1.2.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import amount
from rigsight.effects.symbols import beyond, u

u_0 = sp.Symbol("u_0", real=True)

INPUT_DEAD_ZONE = Effect(
    name="input_dead_zone",
    place=Place.ACTUATOR,
    family=Family.DRIVE_LIMIT,
    summary="Small drive inputs have no effect.",
    parameters=(
        amount("u_0", "half-width of the dead zone", "input", starts=(0.05, 0.2), search=(0.0, 2.0)),
    ),
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.RISES),
    drive=beyond(u, u_0),
)
