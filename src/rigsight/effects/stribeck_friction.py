"""Stribeck friction: dry friction that falls from static to Coulomb level with speed.

Equation
--------
``resisting torque = (T_c + (T_s - T_c) exp(-(x'/w_s)^2)) sign(x')``, sticking within +-T_s.

=========  =========================================
T_c        Coulomb level at high speed [force]
T_s        level at standstill [force]
w_s        Stribeck velocity
=========  =========================================

T_s is at least T_c: dry friction that rises with speed follows another law, such as a smoothed sign function.

Applies to lubricated contacts that pass slowly through standstill. Cannot be distinguished from Coulomb friction unless the
records contain slow motion around w_s.

Signature: like Coulomb friction, with stick-slip at low speed.

References: B. Armstrong-Helouvry et al., Automatica 30 (1994) 1083.
"""

import sympy as sp

from rigsight.effects.effect import Start
from rigsight.effects.kinds import amount, dry_friction, scale
from rigsight.effects.symbols import drive_size, v, v_size

T_c, T_s, w_s = sp.symbols("T_c T_s w_s", real=True)

STRIBECK_FRICTION = dry_friction(
    name="stribeck_friction",
    summary="Dry friction that is larger at standstill and falls with speed.",
    parameters=(
        amount("T_c", "Coulomb friction at high speed", "drive", starts=(0.05, 0.2), search=(0.0, 2.0)),
        amount("T_s", "friction at standstill", "drive", starts=(0.1, 0.4), search=(0.0, 4.0)),
        scale("w_s", "Stribeck velocity", "x time^-1", starts=(0.1, 0.02), search=(1e-3, 3.0)),
    ),
    ordered=(("T_s", "T_c"),),
    torque=(T_c + (T_s - T_c) * sp.exp(-((v / w_s) ** 2))) * sp.sign(v),
    starts=(
        Start({"T_c": 0.05 * drive_size, "T_s": 0.1 * drive_size, "w_s": 0.1 * v_size}),
        *(
            Start({"T_c": T_c, "T_s": excess * T_c, "w_s": share * v_size}, parent="coulomb_friction")
            for excess, share in ((1.5, 0.1), (1.3, 0.02), (2.0, 0.3))
        ),
    ),
)
