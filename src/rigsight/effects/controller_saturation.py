"""Limit of what a controller puts out.

Equation
--------
``output`` limited to +-o_max.

o_max: largest output, in units of the signal of the drive: the largest force over the gain; the effect vanishes where it is
beyond all outputs.

Applies to position drives whose force is limited. Where the law is the signal of a drive, saturation of its input is the same,
and this effect is not offered.

Signature: a goal that jumps is followed at a limited acceleration.

References: K. J. Astrom and T. Hagglund, *Advanced PID Control* (ISA 2006), chapter 3.
"""

import sympy as sp

from rigsight.effects.effect import GainTrend, Signature
from rigsight.effects.kinds import limit, of_controller
from rigsight.effects.symbols import clamp, output

o_max = sp.Symbol("o_max", real=True)

CONTROLLER_SATURATION = of_controller(
    name="controller_saturation",
    summary="The output of the controller cannot exceed a limit.",
    parameters=(
        limit("o_max", "largest output", "input", lower=0.0, starts=(0.05, 0.2), search=(0.003, 2.0)),
    ),
    signature=Signature(gain_trend=GainTrend.FALLS),
    control=clamp(output, o_max),
)
