"""Coulomb (dry) friction with sticking.

Equation
--------
``resisting torque = T_c sign(x')``; at rest it balances the other torques as long as they stay within +-T_c.

T_c: friction torque [force]; the effect vanishes at 0.

Applies to guides, seals and bearings that move by much more than their pre-sliding displacement. For displacements of that
size, see presliding friction; for friction that falls with speed, Stribeck friction.

Signature: small inputs move nothing, the apparent damping falls with amplitude; odd harmonics; flat tops at reversals.

References: C. Canudas de Wit et al., IEEE TAC 40 (1995) 419; A. F. Filippov, *Differential Equations with Discontinuous
Righthand Sides* (Kluwer 1988), for sticking.
"""

import sympy as sp

from rigsight.effects.kinds import amount, dry_friction
from rigsight.effects.symbols import v

T_c = sp.Symbol("T_c", real=True)

COULOMB_FRICTION = dry_friction(
    name="coulomb_friction",
    summary="Dry friction of constant size opposes the motion; the mass sticks while the torque is small.",
    parameters=(amount("T_c", "Coulomb friction", "drive", starts=(0.05, 0.3), search=(0.0, 2.0)),),
    torque=T_c * sp.sign(v),
)
