"""Load-dependent Stribeck friction: dry friction that grows with the load of the joint and falls with speed.

Equation
--------
``resisting torque = (T_c + mu |load|) (1 + s exp(-(x'/w_s)^2)) sign(x')``, sticking within +-(T_c + mu |load|) (1 + s);
``load`` as in load-dependent friction.

===  =================================================================
T_c  friction at high speed without load [force]
mu   friction per load
s    excess at standstill over high speed; the effect vanishes where T_c and mu are 0
w_s  Stribeck velocity
===  =================================================================

Applies to geared servos and worm drives that pass slowly through standstill. It is told from load-dependent friction by slow
motion around w_s, and from Stribeck friction by loads that vary.

Signature: like Coulomb friction, with stick-slip at low speed, the more the larger the drive.

References: M. Duclusaud et al., *Extended Friction Models for the Physics Simulation of Servo Actuators* (arXiv 2410.08650),
model M4 with one ratio of the two levels.
"""

import sympy as sp

from rigsight.effects.effect import Start
from rigsight.effects.kinds import amount, dry_friction, scale
from rigsight.effects.symbols import drive_size, load, v, v_size
from rigsight.parameters import Parameter

T_c, mu, s, w_s = sp.symbols("T_c mu s w_s", real=True)

LOAD_DEPENDENT_STRIBECK_FRICTION = dry_friction(
    name="load_dependent_stribeck_friction",
    summary="Dry friction grows with the load of the joint, and is larger at standstill.",
    parameters=(
        amount("T_c", "friction at high speed without load", "drive", starts=(0.05, 0.1), search=(0.0, 2.0)),
        amount("mu", "friction per load", "", starts=(0.1, 0.2), search=(0.0, 0.5)),
        Parameter(
            "s",
            "excess at standstill over high speed",
            "",
            lower=0.0,
            upper=100.0,
            starts=(0.5, 1.0),
            search=(0.02, 3.0),
        ),
        scale("w_s", "Stribeck velocity", "x time^-1", starts=(0.1, 0.02), search=(1e-3, 3.0)),
    ),
    torque=(T_c + mu * sp.Abs(load)) * (1 + s * sp.exp(-((v / w_s) ** 2))) * sp.sign(v),
    starts=(
        Start({"T_c": 0.05 * drive_size, "mu": sp.Float(0.1), "s": sp.Float(0.5), "w_s": 0.1 * v_size}),
        *(
            Start(
                {"T_c": T_c, "mu": mu, "s": sp.Float(0.5), "w_s": share * v_size},
                parent="load_dependent_friction",
            )
            for share in (0.1, 0.02)
        ),
    ),
)
