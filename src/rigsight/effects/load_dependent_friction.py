"""Load-dependent friction: dry friction that grows with the load of the joint.

Equation
--------
``resisting torque = (T_c + mu |load|) sign(x')``, sticking within +-(T_c + mu |load|);
``load`` is the torque of the drives along the joint less what its spring, weight and neighbors push along it.

===  =======================================================================
T_c  friction without load [force]; the effect vanishes where mu is 0 as well
mu   friction per load
===  =======================================================================

The load is that of the published models of servo actuators, motor torque less external torque: where the motor holds a weight it
is twice the weight, as the gears are pressed from both sides. Forces of inertia do not count. Of one mass the motor torque is
the drive's force and the external torque that of the spring; on a bench that prescribes the motion the load is the spring's
force.

Applies to geared servos, worm drives and screws. Can be distinguished from Coulomb friction only if the load varies: by several
payloads, or by a weight or spring that acts with and against the motion. Friction that also falls with speed is Stribeck
friction.

Signature: like Coulomb friction, but the jump of the force at a reversal grows with the drive.

References: M. Duclusaud et al., *Extended Friction Models for the Physics Simulation of Servo Actuators* (arXiv 2410.08650),
model M3; P. Hamon, M. Gautier and P. Garrec, IEEE/RSJ IROS (2010) 6187, on friction of robot joints over load and speed.
"""

import sympy as sp

from rigsight.effects.effect import Start
from rigsight.effects.kinds import amount, dry_friction
from rigsight.effects.symbols import drive_size, load, v

T_c, mu = sp.symbols("T_c mu", real=True)

LOAD_DEPENDENT_FRICTION = dry_friction(
    name="load_dependent_friction",
    summary="Dry friction grows with the load that the joint carries.",
    parameters=(
        amount("T_c", "friction without load", "drive", starts=(0.05, 0.1), search=(0.0, 2.0)),
        amount("mu", "friction per load", "", starts=(0.1, 0.2), search=(0.0, 1.0)),
    ),
    torque=(T_c + mu * sp.Abs(load)) * sp.sign(v),
    starts=(
        Start({"T_c": 0.05 * drive_size, "mu": sp.Float(0.1)}),
        Start({"T_c": T_c / 2, "mu": T_c / (2 * drive_size)}, parent="coulomb_friction"),
    ),
)
