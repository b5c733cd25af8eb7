"""Maxwell branch: a second spring in series with a damper, parallel to the spring.

Equation
--------
``resisting torque = k_m q``,  ``q' = x' - q / tau_m``

=====  ===========================================================================
k_m    stiffness of the branch; the effect vanishes at 0
tau_m  relaxation time: damping of the damper over k_m
=====  ===========================================================================

q is the deflection of the branch's own spring. With it the rig's own spring is that of very slow motion; the three together are
the standard linear solid (Zener's model).

Applies to rubber, belts, ropes, hydraulic bushings and gears with plastic teeth, whose stiffness grows with frequency. Loops
whose width does not depend on speed are hysteresis; an additional resonance is a flexible mode.

Signature: stiffness that rises and damping that falls about the frequency 1 / tau_m, at every amplitude; creep after a step.

References: J. D. Ferry, *Viscoelastic Properties of Polymers* (Wiley 1980), chapter 1.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature, Start, State
from rigsight.effects.kinds import amount, scale
from rigsight.effects.symbols import drive_size, time_size, v, x_size

k_m, tau_m, q = sp.symbols("k_m tau_m q", real=True)


def _at(ratio: float) -> Start:
    """Start with a third of the drive's force, relaxing in `ratio` times the period of the motion over 2 pi."""
    return Start({"k_m": 0.3 * drive_size / x_size, "tau_m": ratio * time_size})


MAXWELL_BRANCH = Effect(
    name="maxwell_branch",
    place=Place.DYNAMICS,
    family=Family.VISCOELASTICITY,
    summary="A second spring in series with a damper acts in parallel to the spring and relaxes.",
    parameters=(
        amount("k_m", "stiffness of the branch", "force x^-1", starts=(0.3, 0.8), search=(0.0, 10.0)),
        scale("tau_m", "relaxation time", "time", upper=1e9, starts=(1.0, 3.0), search=(0.01, 100.0)),
    ),
    energy=Energy.DISSIPATIVE,
    signature=Signature(gain_trend=GainTrend.STEADY),
    torque=k_m * q,
    states=(State(q, v - q / tau_m, "x"),),
    starts=(_at(0.5), _at(5.0)),
)
