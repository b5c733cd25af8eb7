"""A force element on a bench that prescribes the motion: ``force = k x + d x' + force_off``."""

from __future__ import annotations

import sympy as sp

from rigsight.parameters import Parameter
from rigsight.rigs.rig import Motion, Rig, Signal

x, w = sp.symbols("x_position w", real=True)
d, k = sp.symbols("d k", real=True)
force_off = sp.Symbol("force_off", real=True)

ELEMENT = Rig(
    name="element",
    summary="A bench moves a damper, joint or suspension; its force is measured.",
    inputs=(Signal("x", "m", "prescribed displacement"),),
    outputs=(Signal("force", "N", "force of the element"),),
    constants=(),
    parameters=(
        Parameter("d", "viscous damping", "force time x^-1", "N s/m", lower=-1e15, upper=1e15),
        Parameter("k", "stiffness", "force x^-1", "N/m", lower=-1e18, upper=1e18),
        Parameter("force_off", "constant force", "force", "N", lower=-1e12, upper=1e12, default=0.0),
    ),
    motion=Motion(
        displacement=x,
        velocity=w,
        stiffness=k,
        damping=d,
        drive_gain=sp.Integer(0),
        rest=sp.Integer(0),
        bias=force_off,
        inertia=None,
    ),
    units={"x": "m", "force": "N", "time": "s"},
)
