"""Coasting bridge: a motor behind a PWM bridge is braked by its back-EMF only while the bridge is on.

Equation
--------
``drive = u - c_b |u| x'``

c_b: drive input that is lost per input and speed; the effect vanishes at 0, ``1 / c_b`` is the no-load speed.

Applies to brushed motors whose bridge opens in the pauses of the PWM (fast decay, "coast"): at a duty u the voltage drives the
current, and the back-EMF brakes, for the share abs(u) of the time. A bridge that shorts the motor in the pauses ("brake") is
linear: its back-EMF is part of the viscous damping.

Signature: damping and bandwidth grow with the input; without input the motor coasts.

References: N. Mohan, T. M. Undeland and W. P. Robbins, *Power Electronics* (Wiley 2003), chapter 7.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.symbols import u, v
from rigsight.parameters import Parameter

c_b = sp.Symbol("c_b", real=True)

COASTING_BRIDGE = Effect(
    name="coasting_bridge",
    place=Place.ACTUATOR,
    family=Family.DAMPING_LAW,
    summary="Back-EMF brakes the motor only while the bridge drives it.",
    parameters=(
        Parameter(
            "c_b",
            "share of the drive input lost per speed",
            "x^-1 time",
            null=0.0,
            lower=0.0,
            upper=1e12,
            starts=(0.3, 1.0),
            search=(0.0, 10.0),
        ),
    ),
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    drive=u - c_b * sp.Abs(u) * v,
)
