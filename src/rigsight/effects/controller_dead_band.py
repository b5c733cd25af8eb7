"""Dead band of a controller.

Equation
--------
The error counts only beyond +-e_0: ``error - e_0`` above, ``error + e_0`` below, zero between.

e_0: half-width of the dead band, in units of the signal of the drive; the effect vanishes at 0.

Applies to hobby servos, which rest within a dead band so that they do not hum.

Signature: the reading stops short of the goal by up to the band, on the side from which it comes.

References: K. J. Astrom and T. Hagglund, *Advanced PID Control* (ISA 2006), chapter 3.
"""

import sympy as sp

from rigsight.effects.effect import GainTrend, Signature
from rigsight.effects.kinds import amount, of_controller
from rigsight.effects.symbols import beyond, error, output

e_0 = sp.Symbol("e_0", real=True)

CONTROLLER_DEAD_BAND = of_controller(
    name="controller_dead_band",
    summary="The controller ignores small errors.",
    parameters=(
        amount("e_0", "half-width of the dead band", "input", starts=(0.02, 0.1), search=(0.0, 1.0)),
    ),
    signature=Signature(gain_trend=GainTrend.FALLS),
    control=output - error + beyond(error, e_0),
)
