"""Flexible gear: a spring and a damper stand between the rotor, which drive and sensor turn, and the link behind it.

Equation
--------
``torque = (T_k - r (driven - damped)) / (1 - r) - (load - driven)``,  ``T_k = r m (w_a^2 (x - s) + 2 zeta_a w_a (x' - s'))``,
``r m s'' = T_k - (load - driven)``

======  ==============================================================================
r       part of the inertia m of the joint that is behind the gear; the effect vanishes at 0
w_a     angular frequency of the link where the rotor is held
zeta_a  its damping ratio there
======  ==============================================================================

The rotor keeps ``(1 - r) m``, the force of the drives, ``driven``, and that of the joint's damper, ``damped``. Weight and
springs, ``load - driven``, act on the link as if it were where the rotor is: the gear is stiff against them.

Applies to harmonic drives, belts and couplings of a joint whose model is rigid and whose link is known. Where the inertia of the
joint is free, a flexible mode is the same, and this effect is not offered.

Signature: a second resonance and an antiresonance at w_a, at every amplitude.

References: M. W. Spong, ASME J. Dyn. Syst. Meas. Control 109 (1987) 310, on flexible joints.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature, Start, State
from rigsight.effects.kinds import amount, scale
from rigsight.effects.symbols import damped, driven, load, m, time_size, v, x

r, w_a, zeta_a, s, s_rate = sp.symbols("r w_a zeta_a s s_rate", real=True)

_pull = w_a**2 * (x - s) + 2 * zeta_a * w_a * (v - s_rate)
_resists = load - driven


def _at(ratio: float) -> Start:
    """Start with the mode at `ratio` times the rig's angular frequency."""
    values = {"r": 0.5, "w_a": ratio / time_size, "zeta_a": 0.05}
    return Start({name: sp.sympify(value) for name, value in values.items()})


FLEXIBLE_GEAR = Effect(
    name="flexible_gear",
    place=Place.DYNAMICS,
    family=Family.RESONANCE,
    summary="A spring stands between the rotor and the link behind it.",
    parameters=(
        amount(
            "r", "part of the inertia behind the gear", "", upper=0.999, starts=(0.5, 0.2), search=(0.0, 0.98)
        ),
        scale(
            "w_a",
            "angular frequency of the link",
            "time^-1",
            upper=1e9,
            starts=(2.0, 4.0),
            search=(0.5, 50.0),
        ),
        scale(
            "zeta_a", "its damping ratio", "", lower=1e-6, upper=10.0, starts=(0.05, 0.02), search=(1e-4, 2.0)
        ),
    ),
    # It moves forces of the drive and of the weight from one mass to another: alone it is no passive element.
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.STEADY),
    torque=(r * m * _pull - r * (driven - damped)) / (1 - r) - _resists,
    states=(State(s, s_rate, "x"), State(s_rate, _pull - _resists / (r * m), "x time^-1")),
    starts=tuple(_at(ratio) for ratio in (1.25, 2.4, 4.7, 10.0)),
    needs_inertia=True,
    needs_known_inertia=True,
)
