"""Time shift: one signal's time base stands off from that of the others.

Equation
--------
``measured(t) = x(t - T_x)``, also on an element, where x stands for the force

T_x: time by which the signal is recorded late, below 0 where it is early; the effect vanishes at 0.

Applies to channels of two loggers, to interfaces that buffer, and to columns that were aligned by hand. It shifts the record and
not what a control loop reads; a sensor that is late for the loop as well is a sensor delay, a drive that acts late an input
delay. On a rig that moves freely a late signal is called by these names, an early one by this: no rig answers before it is asked.

Signature: phase in proportion to frequency, magnitude untouched, at every amplitude; on an element loops that open with frequency
like damping, but in every force alike, that of friction too.

References: L. Ljung, *System Identification* (Prentice Hall 1999), section 4.2.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, GainTrend, Place, Signature, Start
from rigsight.effects.symbols import time_size
from rigsight.parameters import Parameter

T_x = sp.Symbol("T_x", real=True)

TIME_SHIFT = Effect(
    name="time_shift",
    place=Place.SENSOR,
    summary="A signal is recorded early or late against the others.",
    parameters=(
        Parameter(
            "T_x",
            "time by which the signal is late",
            "time",
            lower=-1e6,
            upper=1e6,
            null=0.0,
            starts=(-0.05, -0.1),
            search=(-1.0, 1.0),
        ),
    ),
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.STEADY),
    reading_delay=T_x,
    # A fit finds from one wave of the record to the next one only.
    starts=tuple(Start({"T_x": share * time_size}) for share in (-0.6, -0.1, 0.1, 0.6)),
)
