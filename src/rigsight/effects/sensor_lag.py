"""Sensor lag: the displacement is measured through a first-order low pass.

Equation
--------
``T_m x_m' + x_m = x``, x_m is what is measured

T_m: time constant of the sensor; the effect vanishes at 0.

Applies to sensors with an analogue filter or slow electronics. If no other measured signal depends on the displacement, it cannot
be distinguished from a lag of the actuator.

Signature: the displacement loses gain and phase above 1 / T_m; signals that depend on the displacement do not.

References: E. O. Doebelin, *Measurement Systems* (McGraw-Hill 2004), on first-order instruments.
"""

import sympy as sp

from rigsight.effects.effect import Place, State
from rigsight.effects.kinds import amount, late
from rigsight.effects.symbols import reading

T_m, x_m = sp.symbols("T_m x_m", real=True)

SENSOR_LAG = late(
    name="sensor_lag",
    place=Place.SENSOR,
    summary="The displacement is measured through a first-order lag.",
    parameters=(
        amount("T_m", "time constant", "time", starts=(0.05, 0.3), search=(1e-3, 10.0), logarithmic=True),
    ),
    measured=x_m,
    states=(State(x_m, (reading - x_m) / T_m, "x"),),
)
