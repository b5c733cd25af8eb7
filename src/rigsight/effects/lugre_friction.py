"""LuGre friction: dry friction that builds up over a small displacement and falls from static to Coulomb level with speed.

Equation
--------
``resisting torque = T_c (1 + s) z / x_p``,  ``z' = x' - |x'| z (1 + s) / (x_p g)``,  ``g = 1 + s exp(-(x'/w_s)^2)``

===  ======================================================================================
T_c  friction at high speed [force]; the effect vanishes at 0
s    excess at standstill over high speed
w_s  Stribeck velocity
x_p  displacement over which the friction builds up; T_c (1 + s) / x_p is its stiffness
===  ======================================================================================

s is sought up to 3 and x_p below a fifth of the motion: beyond, the element makes loops of any shape, see hysteresis. Bristle
damping is left out: records that slide do not determine it beside viscous damping.

Applies to bearings and gears that reverse often and pass slowly through standstill. It is told from presliding friction by
motion around w_s, and from Stribeck friction by motion within x_p.

Signature: like presliding friction, with stick-slip at low speed.

References: C. Canudas de Wit et al., IEEE TAC 40 (1995) 419.
"""

import sympy as sp

from rigsight.effects.effect import Start, State
from rigsight.effects.kinds import amount, dry_friction, scale
from rigsight.effects.symbols import drive_size, v, v_size, x_size
from rigsight.parameters import Parameter

T_c, T_s, s, w_s, x_p, z = sp.symbols("T_c T_s s w_s x_p z", real=True)

_level = 1 + s * sp.exp(-((v / w_s) ** 2))

LUGRE_FRICTION = dry_friction(
    name="lugre_friction",
    summary="Dry friction deflects like a spring before it slides, and falls with speed.",
    parameters=(
        amount("T_c", "friction at high speed", "drive", starts=(0.1, 0.3), search=(0.0, 2.0)),
        Parameter(
            "s",
            "excess at standstill over high speed",
            "",
            lower=0.0,
            upper=3.0,
            starts=(0.5, 1.0),
            search=(0.02, 3.0),
        ),
        scale("w_s", "Stribeck velocity", "x time^-1", starts=(0.1, 0.3), search=(1e-3, 0.5)),
        scale(
            "x_p",
            "displacement over which the friction builds up",
            "x",
            starts=(0.1, 0.03),
            search=(1e-3, 0.2),
        ),
    ),
    torque=T_c * (1 + s) * z / x_p,
    states=(State(z, v - sp.Abs(v) * z * (1 + s) / (x_p * _level), "x"),),
    starts=(
        Start({"T_c": 0.1 * drive_size, "s": sp.Float(0.5), "w_s": 0.1 * v_size, "x_p": 0.1 * x_size}),
        Start(
            {"T_c": T_c, "s": sp.Float(0.3), "w_s": 0.1 * v_size, "x_p": x_p}, parent="presliding_friction"
        ),
        Start({"T_c": T_c, "s": T_s / T_c - 1, "w_s": w_s, "x_p": 0.02 * x_size}, parent="stribeck_friction"),
    ),
)
