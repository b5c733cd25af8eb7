"""Feed-forward of the commanded velocity.

Equation
--------
``c_f' = (command - c_f) / T_f``, the controller puts out its law plus ``T_w (command - c_f) / T_f``.

T_w: gain of the commanded velocity over that of the position [s]; the effect vanishes at 0.
T_f: time constant of the filter of the rate [s]; it acts like mass.

Applies to drives that follow ramps without lag. Derivative action on the whole error differs by damping alone.

Signature: the reading leads where damping would make it lag; nothing changes without a goal that moves.

References: G. Ellis, *Control System Design Guide* (Elsevier 2012), chapter 8.
"""

import sympy as sp

from rigsight.effects.effect import State
from rigsight.effects.kinds import amount, of_controller, scale
from rigsight.effects.symbols import command, output

T_w, T_f, c_f = sp.symbols("T_w T_f c_f", real=True)

VELOCITY_FEEDFORWARD = of_controller(
    name="velocity_feedforward",
    summary="The controller adds the commanded velocity.",
    parameters=(
        amount(
            "T_w",
            "gain of the velocity over that of the position",
            "time",
            starts=(0.05, 0.3),
            search=(0.0, 3.0),
        ),
        scale("T_f", "filter of the rate", "time", starts=(0.02,), search=(1e-3, 0.3)),
    ),
    control=output + T_w * (command - c_f) / T_f,
    states=(State(c_f, (command - c_f) / T_f, "input"),),
)
