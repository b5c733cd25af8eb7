"""Derivative action of a controller.

Equation
--------
``e_f' = (error - e_f) / T_f``, the controller puts out its law plus ``T_v (error - e_f) / T_f``.

T_v: derivative time [s]; the effect vanishes at 0.
T_f: time constant of the filter of the rate [s]; it acts like mass.

Applies to PD and PID controllers that take the rate of the whole error. Its part of the reading is viscous damping, so beside
free damping it cannot be told from feed-forward of the velocity.

Signature: less lag behind fast goals than damping of the same size leaves.

References: K. J. Astrom and T. Hagglund, *Advanced PID Control* (ISA 2006), chapter 3.
"""

import sympy as sp

from rigsight.effects.effect import State
from rigsight.effects.kinds import amount, of_controller, scale
from rigsight.effects.symbols import error, output

T_v, T_f, e_f = sp.symbols("T_v T_f e_f", real=True)

DERIVATIVE_ACTION = of_controller(
    name="derivative_action",
    summary="The controller reacts to the rate of its error.",
    parameters=(
        amount("T_v", "derivative time", "time", starts=(0.05, 0.3), search=(0.0, 3.0)),
        scale("T_f", "filter of the rate", "time", starts=(0.02,), search=(1e-3, 0.3)),
    ),
    control=output + T_v * (error - e_f) / T_f,
    states=(State(e_f, (error - e_f) / T_f, "input"),),
)
