"""Friction compensation of a controller.

Equation
--------
``c_f' = (command - c_f) / T_f``, the controller puts out its law plus ``u_f (command - c_f) / c_b`` limited to +-u_f: a
constant in the direction in which the goal moves.

u_f: what is added, in units of the signal of the drive; the effect vanishes at 0.
T_f: time constant of the filter, a fiftieth of the time in which the motion advances by a radian; not fitted.
c_b: difference from which all of u_f is added, a thousandth of the signal of the drive; not fitted.

Applies to drives that add the friction of their gear. Too much of it throws the joint ahead of its goal at each reversal.

Signature: jumps of the force at the reversals of the goal, not of the motion.

References: B. Armstrong-Helouvry et al., Automatica 30 (1994) 1083, section 4.
"""

import sympy as sp

from rigsight.effects.effect import GainTrend, Signature, State
from rigsight.effects.kinds import amount, of_controller
from rigsight.effects.symbols import clamp, command, output
from rigsight.parameters import Parameter

u_f, T_f, c_b, c_f = sp.symbols("u_f T_f c_b c_f", real=True)

FRICTION_COMPENSATION = of_controller(
    name="friction_compensation",
    summary="The controller adds a constant in the direction of the goal.",
    parameters=(
        amount("u_f", "what is added", "input", starts=(0.02, 0.1), search=(0.0, 1.0)),
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
        Parameter(
            "c_b",
            "difference from which all is added",
            "input",
            lower=1e-12,
            upper=1e300,
            starts=(1e-3,),
            search=(0.0, 1.0),
            default=1e-3,
            fitted=False,
        ),
    ),
    signature=Signature(gain_trend=GainTrend.FALLS),
    control=output + u_f * clamp(command - c_f, c_b) / c_b,
    states=(State(c_f, (command - c_f) / T_f, "input"),),
)
