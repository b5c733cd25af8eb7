"""Integral and derivative action of a controller together.

Equation
--------
``z' = r_i error``, ``e_f' = (error - e_f) / T_f``, the controller puts out its law plus ``z + T_v (error - e_f) / T_f``.

r_i: reciprocal of the integral time [1/s]; the effect vanishes at 0, together with T_v.
T_v: derivative time [s].
T_f: time constant of the filter of the rate [s]; it acts like mass.

Applies to PID controllers of which only the proportional gain is known. Beside free damping, feed-forward of the velocity with
integral action is the same.

An integral faster than the motion makes the loop unstable: starts are below the reciprocal of its time.

Signature: no lasting error at standstill, and less lag behind fast goals.

References: K. J. Astrom and T. Hagglund, *Advanced PID Control* (ISA 2006), chapter 3.
"""

import sympy as sp

from rigsight.effects.effect import Start, State
from rigsight.effects.kinds import amount, of_controller, scale
from rigsight.effects.symbols import error, output, time_size

r_i, T_v, T_f, z, e_f = sp.symbols("r_i T_v T_f z e_f", real=True)

PID_ACTION = of_controller(
    name="pid_action",
    summary="The controller integrates its error and reacts to the rate of it.",
    parameters=(
        amount("r_i", "reciprocal of the integral time", "time^-1", starts=(0.1, 0.3), search=(0.0, 20.0)),
        amount("T_v", "derivative time", "time", starts=(0.05, 0.3), search=(0.0, 3.0)),
        scale("T_f", "filter of the rate", "time", starts=(0.02,), search=(1e-3, 0.3)),
    ),
    control=output + z + T_v * (error - e_f) / T_f,
    states=(State(z, r_i * error, "input"), State(e_f, (error - e_f) / T_f, "input")),
    starts=(
        Start({"r_i": 0.1 / time_size, "T_v": 0.05 * time_size, "T_f": 0.02 * time_size}),
        Start({"r_i": r_i, "T_v": 0.05 * time_size, "T_f": 0.02 * time_size}, parent="integral_action"),
        Start({"r_i": 0.1 / time_size, "T_v": T_v, "T_f": T_f}, parent="derivative_action"),
    ),
)
