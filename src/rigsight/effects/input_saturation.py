"""Saturation of the input.

Equation
--------
``drive = u`` limited to +-u_max

u_max: largest drive input; the effect vanishes where it is beyond all inputs.

Applies to current and force limits. Invisible in records that stay below the limit.

Signature: gain at every frequency falls in proportion above one input amplitude; odd harmonics.

References: H. K. Khalil, *Nonlinear Systems* (Prentice Hall 2002), section 1.2.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import limit
from rigsight.effects.symbols import clamp, u

u_max = sp.Symbol("u_max", real=True)

INPUT_SATURATION = Effect(
    name="input_saturation",
    place=Place.ACTUATOR,
    family=Family.DRIVE_LIMIT,
    summary="The drive cannot exceed a limit.",
    parameters=(
        # Far beyond the inputs of a fit without it, which takes what the limit cuts off for a small gain of the drive.
        limit("u_max", "largest drive input", "input", lower=0.0, starts=(0.8, 0.4), search=(0.02, 2.0)),
    ),
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    drive=clamp(u, u_max),
)
