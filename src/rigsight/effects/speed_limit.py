"""Speed limit: the drive cannot give more than its torque-speed line, which falls with speed.

Equation
--------
``drive = u`` limited from above to ``u_s - c_u x'`` and from below to ``-u_s - c_u x'``

===  ==================================================================================================
u_s  largest drive input at standstill (stall); the effect vanishes where it is beyond all inputs
c_u  drive input that is lost per speed (back-EMF); ``u_s / c_u`` is the no-load speed
===  ==================================================================================================

Applies to motors under current or torque control whose supply voltage is used up by back-EMF, and to hydraulic drives at full
flow. At c_u = 0 this is input saturation. The back-EMF of a voltage-driven motor reduces the torque at every input; that is the
same as viscous damping.

Signature: gain falls above an input amplitude, which is lower where velocity is high and in phase with the input; odd harmonics.

References: A. Hughes and B. Drury, *Electric Motors and Drives* (Newnes 2013), on the torque-speed curve of DC motors.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature, Start
from rigsight.effects.kinds import limit
from rigsight.effects.symbols import beyond, input_size, u, v, v_size
from rigsight.parameters import Parameter

u_s, c_u, u_max = sp.symbols("u_s c_u u_max", real=True)

SPEED_LIMIT = Effect(
    name="speed_limit",
    place=Place.ACTUATOR,
    family=Family.DRIVE_LIMIT,
    summary="The largest drive input falls with speed.",
    parameters=(
        limit(
            "u_s",
            "largest drive input at standstill",
            "input",
            lower=0.0,
            starts=(0.8, 0.5),
            search=(0.02, 3.0),
        ),
        Parameter(
            "c_u",
            "drive input lost per speed",
            "input time x^-1",
            lower=0.0,
            upper=1e12,
            starts=(0.3, 1.0),
            search=(0.0, 3.0),
        ),
    ),
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    drive=u - beyond(u + c_u * v, u_s),
    starts=(
        *(Start({"u_s": reach * input_size, "c_u": 0.5 * input_size / v_size}) for reach in (0.9, 1.8)),
        *(
            Start({"u_s": u_max, "c_u": lost * u_max / v_size}, parent="input_saturation")
            for lost in (0.2, 0.0)
        ),
    ),
)
