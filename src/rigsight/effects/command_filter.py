"""Filter of the command.

Equation
--------
``T_c c_c' + c_c = command``, the law reads c_c in place of the command.

T_c: time constant [s]; the effect vanishes at 0.

Applies to controllers that smooth their goal. Where the law is the force of a position drive, a lag of the drive is the same,
and this effect is not offered.

Signature: lag behind the goal at every amplitude, without a change of the damping of the loop.

References: K. J. Astrom and T. Hagglund, *Advanced PID Control* (ISA 2006), chapter 3.
"""

import sympy as sp

from rigsight.effects.effect import State
from rigsight.effects.kinds import amount, of_controller
from rigsight.effects.symbols import command

T_c, c_c = sp.symbols("T_c c_c", real=True)

COMMAND_FILTER = of_controller(
    name="command_filter",
    summary="The controller follows a smoothed command.",
    parameters=(
        amount("T_c", "time constant", "time", starts=(0.05, 0.3), search=(1e-3, 10.0), logarithmic=True),
    ),
    command=c_c,
    states=(State(c_c, (command - c_c) / T_c, "input"),),
)
