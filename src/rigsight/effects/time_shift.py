"""Time shift: the time base of one signal is offset from that of the others.

Equation
--------
``measured(t) = x(t - T_x)``, also on an element, where x stands for the force

T_x: time by which the signal is recorded late, below 0 where it is early; the effect vanishes at 0.

Applies to channels of two loggers, to interfaces that buffer, and to columns that were aligned by hand. Only the record is
shifted, not the signal that a control loop reads; if the loop also sees the late signal, the effect is a sensor delay, and if the
drive acts late, an input delay. On a rig with a driven mass a late signal is called a sensor or input delay and only an early
signal a time shift, because the output cannot precede the input.

Signature: phase in proportion to frequency, magnitude untouched, at every amplitude; on an element the loops open with frequency,
like damping, but equally for every part of the force, including friction.

References: L. Ljung, *System Identification* (Prentice Hall 1999), section 4.2.
"""

import sympy as sp

from rigsight.effects.effect import Place, Start
from rigsight.effects.kinds import late, signed
from rigsight.effects.symbols import time_size

T_x = sp.Symbol("T_x", real=True)

TIME_SHIFT = late(
    name="time_shift",
    place=Place.SENSOR,
    summary="The time stamps of one signal are early or late relative to the others.",
    parameters=(
        signed(
            "T_x",
            "time by which the signal is late",
            "time",
            lower=-1e6,
            upper=1e6,
            starts=(-0.05, -0.1),
            search=(-1.0, 1.0),
        ),
    ),
    reading_delay=T_x,
    # A fit finds from one wave of the record to the next one only.
    starts=tuple(Start({"T_x": share * time_size}) for share in (-0.6, -0.1, 0.1, 0.6)),
)
