"""Directional friction: dry friction that differs between the two directions.

Equation
--------
``resisting torque = T_fwd`` while x' > 0, ``-T_bwd`` while x' < 0; at rest it balances the other torques as long as they stay
between -T_bwd and T_fwd.

=====  ==========================================================
T_fwd  friction while x' is positive [force]
T_bwd  friction while x' is negative [force]; vanishes with T_fwd
=====  ==========================================================

Applies to lip seals, worm and screw drives, wipers and brushes, whose contact depends on the direction. The equation is that of
Coulomb friction (T_fwd + T_bwd) / 2 plus a constant force (T_fwd - T_bwd) / 2; the two can be distinguished only if the constant
force at the joint, or the rest position of its spring, is known.

Signature: like Coulomb friction, and the mean position shifts with the motion; even harmonics.

References: B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, Automatica 30 (1994) 1083, on friction that depends on the
direction.
"""

import sympy as sp

from rigsight.effects.effect import GainTrend, Signature, Start
from rigsight.effects.kinds import amount, dry_friction
from rigsight.effects.symbols import drive_size, v

T_fwd, T_bwd, T_c = sp.symbols("T_fwd T_bwd T_c", real=True)

DIRECTIONAL_FRICTION = dry_friction(
    name="directional_friction",
    summary="Dry friction is larger in one direction than in the other.",
    parameters=(
        amount("T_fwd", "friction while x' is positive", "drive", starts=(0.15, 0.3), search=(0.0, 2.0)),
        amount("T_bwd", "friction while x' is negative", "drive", starts=(0.05, 0.1), search=(0.0, 2.0)),
    ),
    signature=Signature(gain_trend=GainTrend.RISES, even_harmonics=True),
    torque=T_fwd * (1 + sp.sign(v)) / 2 - T_bwd * (1 - sp.sign(v)) / 2,
    starts=(
        Start({"T_fwd": 0.1 * drive_size, "T_bwd": 0.1 * drive_size}),
        Start({"T_fwd": T_c, "T_bwd": T_c}, parent="coulomb_friction"),
    ),
)
