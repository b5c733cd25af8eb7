"""Torque ripple: a torque that is periodic in the position.

Equation
--------
``resisting torque = T_sin sin(kappa position) + T_cos cos(kappa position)``

=====  =====================================================================================================
T_sin  part that is zero at the origin of the position [force]; the effect vanishes where both parts are 0
T_cos  part that is largest there [force]
kappa  wave number: periods per turn of an angle in rad, 2 pi over the period of a displacement
=====  =====================================================================================================

The amplitude is ``sqrt(T_sin^2 + T_cos^2)``, the phase ``atan2(T_cos, T_sin)``. The position counts from the origin of its own
sensor, wherever the spring rests.

Applies to the cogging of motors with magnets, to gear teeth, ball screws and eccentric pulleys. A torque that is periodic in
time, independent of the motion, is a periodic disturbance.

Signature: spectral lines whose frequency is proportional to speed; a mass at rest settles in the nearest stable position; even
harmonics where that is not the center of the motion.

References: T. M. Jahns and W. L. Soong, IEEE Trans. Ind. Electron. 43 (1996) 321, on pulsating torque and cogging.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import scale, signed
from rigsight.effects.symbols import position

T_sin, T_cos, kappa = sp.symbols("T_sin T_cos kappa", real=True)

TORQUE_RIPPLE = Effect(
    name="torque_ripple",
    place=Place.DYNAMICS,
    family=Family.TONE_OR_RIPPLE,
    summary="A torque is periodic in the position: cogging, gear teeth, an eccentric pulley.",
    parameters=(
        signed(
            "T_sin",
            "part that is zero at the origin",
            "drive",
            lower=-1e15,
            upper=1e15,
            starts=(0.1, 0.05),
            search=(-2.0, 2.0),
        ),
        signed(
            "T_cos",
            "part that is largest at the origin",
            "drive",
            lower=-1e15,
            upper=1e15,
            starts=(0.05, -0.1),
            search=(-2.0, 2.0),
        ),
        scale("kappa", "wave number", "x^-1", starts=(6.0, 15.0), search=(3.3, 60.0)),
    ),
    energy=Energy.CONSERVATIVE,
    wave_number="kappa",
    signature=Signature(gain_trend=GainTrend.RISES, even_harmonics=True),
    torque=T_sin * sp.sin(kappa * position) + T_cos * sp.cos(kappa * position),
)
