"""Presliding friction (Dahl): dry friction that builds up over a small displacement, like a yielding spring.

Equation
--------
``resisting torque = T_c z / x_p``,  ``z' = x' - |x'| z / x_p``

===  ============================================================================
T_c  friction once it slides [force]; the effect vanishes at 0
x_p  displacement over which the friction builds up; T_c / x_p is its stiffness
===  ============================================================================

This is the Bouc-Wen element with n = 1 and gamma = 0 and without a parallel spring, or the LuGre model without bristle damping
and without friction that falls with speed. It is preferred to LuGre because records with motion larger than x_p do not determine
these two in addition to the viscous damping. For friction that falls with speed, see Stribeck friction.

Applies to ball bearings, guides and gears that reverse often or stand still under a small torque: they deflect elastically before
they slide. As x_p goes to 0 this is Coulomb friction.

Signature: stiffer at small amplitude, like an additional spring that has no effect in large motions; rounded loops at any speed;
odd harmonics.

References: P. R. Dahl, *A Solid Friction Model* (Aerospace Corporation TOR-0158, 1968); C. Canudas de Wit et al., IEEE TAC 40
(1995) 419 (LuGre).
"""

import sympy as sp

from rigsight.effects.effect import Start, State
from rigsight.effects.kinds import amount, dry_friction, scale
from rigsight.effects.symbols import drive_size, v, x_size

T_c, x_p, z = sp.symbols("T_c x_p z", real=True)

PRESLIDING_FRICTION = dry_friction(
    name="presliding_friction",
    summary="Dry friction deflects like a spring before it slides.",
    parameters=(
        amount("T_c", "friction once it slides", "drive", starts=(0.1, 0.3), search=(0.0, 2.0)),
        scale(
            "x_p",
            "displacement over which the friction builds up",
            "x",
            starts=(0.1, 0.3),
            search=(1e-3, 10.0),
        ),
    ),
    torque=T_c * z / x_p,
    states=(State(z, v - sp.Abs(v) * z / x_p, "x"),),
    starts=(
        Start({"T_c": 0.1 * drive_size, "x_p": 0.2 * x_size}),
        *(Start({"T_c": T_c, "x_p": share * x_size}, parent="coulomb_friction") for share in (0.1, 0.02)),
    ),
)
