"""Back-driving friction: dry friction with one coefficient for the force of the motor and another one for that of the load.

Equation
--------
``resisting torque = (T_c + |mu_m driven + mu_e (load - driven)|) sign(x')``, sticking within the bracket; ``driven`` is the force
of the drives along the joint, ``load - driven`` what its spring, weight and neighbors resist with.

====  =============================================================================
T_c   friction without load [force]; the effect vanishes where mu_m and mu_e are 0 as well
mu_m  friction per force of the motor
mu_e  friction per force of the load
====  =============================================================================

With one coefficient this is load-dependent friction: its load is the sum of both.

Applies to worm drives, screws and gears of a high ratio, which are easier to drive than to drive back. It is told from
load-dependent friction by a weight or spring that acts with and against the motion.

Signature: like Coulomb friction, with another jump of the force where the load drives than where the motor does.

References: M. Duclusaud et al., *Extended Friction Models for the Physics Simulation of Servo Actuators* (arXiv 2410.08650),
model M5 without its part that falls with speed.
"""

import sympy as sp

from rigsight.effects.effect import Start
from rigsight.effects.kinds import amount, dry_friction
from rigsight.effects.symbols import drive_size, driven, load, v

T_c, mu, mu_m, mu_e = sp.symbols("T_c mu mu_m mu_e", real=True)

BACK_DRIVING_FRICTION = dry_friction(
    name="back_driving_friction",
    summary="Dry friction grows with the force of the motor and, otherwise, with that of the load.",
    parameters=(
        amount("T_c", "friction without load", "drive", starts=(0.05, 0.1), search=(0.0, 2.0)),
        amount("mu_m", "friction per force of the motor", "", starts=(0.1, 0.2), search=(0.0, 1.0)),
        amount("mu_e", "friction per force of the load", "", starts=(0.2, 0.1), search=(0.0, 1.0)),
    ),
    torque=(T_c + sp.Abs(mu_m * driven + mu_e * (load - driven))) * sp.sign(v),
    starts=(
        Start({"T_c": 0.05 * drive_size, "mu_m": sp.Float(0.1), "mu_e": sp.Float(0.2)}),
        Start({"T_c": T_c, "mu_m": 0.7 * mu, "mu_e": 1.4 * mu}, parent="load_dependent_friction"),
        Start({"T_c": T_c, "mu_m": 1.4 * mu, "mu_e": 0.7 * mu}, parent="load_dependent_friction"),
    ),
)
