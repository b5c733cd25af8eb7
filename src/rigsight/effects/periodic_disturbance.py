"""Periodic disturbance: an external torque that is periodic in time, independent of the drive.

Equation
--------
``torque = -T_p sin(phi)``,  ``phi' = w_p``, phi free at the start of each record

===  ==============================================
T_p  amplitude of the torque; the effect vanishes at 0
w_p  angular frequency
===  ==============================================

Applies to eccentric rollers, unbalance at constant speed, cogging and mains hum. Does not describe a disturbance whose speed
follows the motion.

Signature: a spectral line in the response that stays at its frequency when the excitation changes or stops.

References: L. Ljung, *System Identification* (Prentice Hall 1999), on periodic disturbances.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature, State
from rigsight.effects.kinds import scale, signed

T_p, w_p, phi = sp.symbols("T_p w_p phi", real=True)

PERIODIC_DISTURBANCE = Effect(
    name="periodic_disturbance",
    place=Place.DISTURBANCE,
    family=Family.TONE_OR_RIPPLE,
    summary="An external torque is periodic in time, independent of the drive.",
    parameters=(
        signed("T_p", "amplitude", "drive", lower=-1e15, upper=1e15, starts=(0.05,), search=(0.0, 2.0)),
        scale("w_p", "angular frequency", "time^-1", upper=1e9, starts=(2.0, 0.8), search=(0.02, 50.0)),
    ),
    energy=Energy.ACTIVE,
    pulsation="w_p",
    signature=Signature(gain_trend=GainTrend.STEADY),
    torque=-T_p * sp.sin(phi),
    states=(State(phi, w_p, ""),),
)
