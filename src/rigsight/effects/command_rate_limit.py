"""Rate limit of the command.

Equation
--------
``c_l' = (command - c_l) / T_f`` limited to +-w_c; the law reads ``c_l + (command - c_l)`` with the bracket limited to
+-w_c T_f: the command itself where it changes slowly.

w_c: largest rate, in units of the signal of the drive.
T_f: time in which the command is reached below the limit, a fiftieth of the time in which the motion advances by a radian; not
fitted.

Applies to servos with a profile of the speed. Invisible where goals stay slower.

Signature: fast goals come out as triangles, small ones unchanged.

References: K. J. Astrom and T. Hagglund, *Advanced PID Control* (ISA 2006), chapter 3.
"""

import sympy as sp

from rigsight.effects.effect import GainTrend, Signature, State
from rigsight.effects.kinds import limit, of_controller
from rigsight.effects.symbols import beyond, clamp, command
from rigsight.parameters import Parameter

w_c, T_f, c_l = sp.symbols("w_c T_f c_l", real=True)

COMMAND_RATE_LIMIT = of_controller(
    name="command_rate_limit",
    summary="The command changes at a limited rate.",
    parameters=(
        limit(
            "w_c",
            "largest rate of the command",
            "input time^-1",
            lower=1e-12,
            starts=(0.7, 0.3),
            search=(0.02, 3.0),
        ),
        Parameter(
            "T_f",
            "filter of the rate",
            "time",
            lower=1e-9,
            upper=1e6,
            starts=(0.02,),
            search=(0.0, 1.0),
            default=1e-3,
            fitted=False,
        ),
    ),
    signature=Signature(gain_trend=GainTrend.FALLS),
    command=command - beyond(command - c_l, w_c * T_f),
    states=(State(c_l, clamp((command - c_l) / T_f, w_c), "input"),),
)
