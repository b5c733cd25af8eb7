"""Flexible mode: a second mass is attached to the moving mass by a spring and a damper.

Equation
--------
``torque = m_a (w_a^2 (x - q) + 2 zeta_a w_a (x' - q'))``,  ``q'' = w_a^2 (x - q) + 2 zeta_a w_a (x' - q')``

======  ==================================================
m_a     inertia of the second mass; the effect vanishes at 0
w_a     its angular frequency where the main mass is held
zeta_a  its damping ratio there
======  ==================================================

Applies to compliant couplings, frames, cables and sensors' brackets that ring. The rig's own inertia is that of the main mass
alone.

Signature: a second resonance and an antiresonance at w_a, at every amplitude.

References: J. P. Den Hartog, *Mechanical Vibrations* (McGraw-Hill 1956), on the dynamic vibration absorber.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature, Start, State
from rigsight.effects.kinds import amount, scale
from rigsight.effects.symbols import m, time_size, v, x

m_a, w_a, zeta_a, q, q_rate = sp.symbols("m_a w_a zeta_a q q_rate", real=True)

_pull = w_a**2 * (x - q) + 2 * zeta_a * w_a * (v - q_rate)


def _at(ratio: float, share: float) -> Start:
    """Start with the mode at `ratio` times the rig's angular frequency, holding `share` of its inertia."""
    values = {"m_a": share * m, "w_a": ratio / time_size, "zeta_a": 0.05}
    return Start({name: sp.sympify(value) for name, value in values.items()})


FLEXIBLE_MODE = Effect(
    name="flexible_mode",
    place=Place.DYNAMICS,
    family=Family.RESONANCE,
    summary="A second mass is attached to the moving mass by a spring and adds a resonance.",
    parameters=(
        amount(
            "m_a",
            "inertia of the second mass",
            "force time^2 x^-1",
            upper=1e9,
            starts=(0.1, 0.3),
            search=(0.0, 5.0),
        ),
        scale("w_a", "its angular frequency", "time^-1", upper=1e9, starts=(2.0, 4.0), search=(0.05, 50.0)),
        scale(
            "zeta_a", "its damping ratio", "", lower=1e-6, upper=10.0, starts=(0.05, 0.02), search=(1e-4, 2.0)
        ),
    ),
    energy=Energy.DISSIPATIVE,
    signature=Signature(gain_trend=GainTrend.STEADY),
    torque=m_a * _pull,
    states=(State(q, q_rate, "x"), State(q_rate, _pull, "x time^-1")),
    starts=tuple(_at(ratio, 0.1) for ratio in (0.5, 0.8, 1.25, 1.7, 2.4, 3.3, 4.7, 6.6)),
    needs_inertia=True,
)
