"""Integral action of the speed loop in a cascaded controller.

Equation
--------
``z' = r_v output``, the controller puts out its law plus z. The law is proportional to the error of the speed, which the
position loop commands: ``output = k_p error - k_v v``.

r_v: reciprocal of the integral time of the speed loop [1/s]; the effect vanishes at 0.

Applies to drives with a position loop around a PI speed loop, as industrial servos have. Without damping in the law it is the
same as integral action, and is not offered.

An integral faster than the motion makes the loop unstable: starts are below the reciprocal of its time.

Signature: stiff against slow loads; a resonance at the bandwidth of the speed loop.

References: H. Gross, J. Hamann and G. Wiegartner, *Electrical Feed Drives in Automation* (Publicis 2001), chapter 5.
"""

import sympy as sp

from rigsight.effects.effect import State
from rigsight.effects.kinds import amount, of_controller
from rigsight.effects.symbols import output

r_v, z = sp.symbols("r_v z", real=True)

SPEED_LOOP_INTEGRAL = of_controller(
    name="speed_loop_integral",
    summary="A speed loop inside the position loop integrates.",
    parameters=(
        amount("r_v", "reciprocal of the integral time", "time^-1", starts=(0.3, 0.1), search=(0.0, 50.0)),
    ),
    control=output + z,
    states=(State(z, r_v * output, "input"),),
)
