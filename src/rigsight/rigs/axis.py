"""One moving mass with a drive: ``m x'' + d x' + k (x - x_off) = gain u + force_off``.

A positioning stage, a pendulum near rest, an electrical oscillator with the same equation. Units are the user's.
"""

from __future__ import annotations

import sympy as sp

from rigsight.parameters import Parameter
from rigsight.rigs.rig import Motion, Rig, Signal

x, w = sp.symbols("x_position w", real=True)
m, d, k, gain = sp.symbols("m d k gain", positive=True)
x_off, force_off = sp.symbols("x_off force_off", real=True)

AXIS = Rig(
    name="axis",
    summary="A drive force moves one mass against a spring and a damper.",
    inputs=(Signal("u", "input", "drive input"),),
    outputs=(Signal("x", "m", "displacement"),),
    constants=(
        Parameter(
            "gain",
            "force per unit of input",
            "force input^-1",
            "N/input",
            lower=-1e12,
            upper=1e12,
            default=1.0,
        ),
    ),
    parameters=(
        Parameter("m", "moving mass", "force time^2 x^-1", "kg", lower=1e-15, upper=1e15, logarithmic=True),
        Parameter("d", "viscous damping", "force time x^-1", "N s/m", lower=0.0, upper=1e15),
        Parameter(
            "k", "stiffness; 0 for an axis without a spring", "force x^-1", "N/m", lower=0.0, upper=1e18
        ),
        Parameter("x_off", "displacement at rest", "x", "m", lower=-1e9, upper=1e9, default=0.0),
        Parameter(
            "force_off", "constant force beside the drive", "force", "N", lower=-1e12, upper=1e12, default=0.0
        ),
    ),
    motion=Motion(
        displacement=x,
        velocity=w,
        stiffness=k,
        damping=d,
        drive_gain=gain,
        rest=x_off,
        bias=force_off,
        inertia=m,
    ),
    units={"x": "m", "force": "N", "input": "input", "time": "s"},
)
