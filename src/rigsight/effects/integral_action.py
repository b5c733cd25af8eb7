"""Integral action of a controller.

Equation
--------
``z' = r_i error``, the controller puts out its law plus z.

r_i: reciprocal of the integral time [1/s]; the effect vanishes at 0.

Applies to servos that hold a load without a lasting error: PI and PID position controllers. It shows where weight or friction
would keep the joint off its goal.

An integral faster than the motion makes the loop unstable: starts are below the reciprocal of its time.

Signature: the error at standstill creeps to zero; phase of the closed loop falls below its bandwidth.

References: K. J. Astrom and T. Hagglund, *Advanced PID Control* (ISA 2006), chapter 3.
"""

import sympy as sp

from rigsight.effects.effect import State
from rigsight.effects.kinds import amount, of_controller
from rigsight.effects.symbols import error, output

r_i, z = sp.symbols("r_i z", real=True)

INTEGRAL_ACTION = of_controller(
    name="integral_action",
    summary="The controller integrates its error.",
    parameters=(
        amount("r_i", "reciprocal of the integral time", "time^-1", starts=(0.1, 0.3), search=(0.0, 20.0)),
    ),
    control=output + z,
    states=(State(z, r_i * error, "input"),),
)
