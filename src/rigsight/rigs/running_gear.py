"""The 1:5 railway running gear: motor current -> yaw angle (PT2) -> lateral displacement (PT1).

``J_z psi'' = b k_tau / r_0 u - k_c (psi - psi_off) - k_d psi'``
``y' = v c_y (psi - psi_off) - v c_y / (2 l_0) (y - y_off - 2 l_0 psi_off) = v c_y (psi - (y - y_off) / (2 l_0))``

Source: thesis, equations (2.11) to (2.25); the damping term is the one of the state matrix, ``2 D omega_0 psi'``
(equations 2.17 and 2.18 print omega_0 squared by mistake).
"""

from __future__ import annotations

import math

import sympy as sp
from scipy.optimize import brentq

from rigsight.errors import InputError
from rigsight.parameters import Parameter
from rigsight.rigs.rig import Lateral, Motion, Rig, Signal

psi, w, y = sp.symbols("psi w y", real=True)
speed, r_0, b, k_tau = sp.symbols("v r_0 b k_tau", positive=True)
J_z, k_c, k_d, l_0, c_y = sp.symbols("J_z k_c k_d l_0 c_y", positive=True)
psi_off, y_off = sp.symbols("psi_off y_off", real=True)

_from_rest, _feedback = y - y_off, 1 / (2 * l_0)
ROLLING = Lateral(
    symbol=y,
    displacement=_from_rest,
    creepage=psi - _from_rest * _feedback,
    gain=speed * c_y,
    feedback=_feedback,
)
"""The lateral displacement of the running gear."""

RUNNING_GEAR = Rig(
    name="running_gear",
    summary="Motor current drives the yaw angle, the yaw angle the lateral displacement of a roller-rig axle.",
    inputs=(Signal("u", "A", "motor current"),),
    outputs=(Signal("psi", "rad", "yaw angle"), Signal("y", "m", "lateral displacement")),
    constants=(
        Parameter("v", "longitudinal velocity", "length time^-1", "m/s", lower=1e-6, upper=1e3),
        Parameter("r_0", "wheel radius", "length", "m", lower=1e-6, upper=1e2),
        Parameter("b", "track width", "length", "m", lower=1e-6, upper=1e2),
        Parameter("k_tau", "motor constant", "force input^-1", "N m/A", lower=1e-9, upper=1e6),
    ),
    parameters=(
        Parameter(
            "J_z",
            "yaw inertia of the axle bridge",
            "force time^2 x^-1",
            "kg m^2",
            lower=1e-9,
            upper=1e9,
            logarithmic=True,
        ),
        Parameter(
            "k_c",
            "equivalent yaw stiffness",
            "force x^-1",
            "N m/rad",
            lower=1e-9,
            upper=1e12,
            logarithmic=True,
        ),
        Parameter("k_d", "equivalent yaw damping", "force time x^-1", "N m s/rad", lower=0.0, upper=1e12),
        Parameter("psi_off", "yaw angle at rest", "x", "rad", lower=-10.0, upper=10.0, default=0.0),
        Parameter(
            "l_0",
            "distance wheel carrier to middle frame",
            "length",
            "m",
            lower=1e-6,
            upper=1e3,
            logarithmic=True,
        ),
        Parameter("c_y", "lateral creep factor (2.12)", "", "1", lower=1e-6, upper=1e3, logarithmic=True),
        Parameter("y_off", "lateral offset", "length", "m", lower=-10.0, upper=10.0, default=0.0),
    ),
    alternative_parameters=(
        Parameter("delta_0", "equivalent conicity, gives c_y by (2.12)", "", "rad", lower=1e-6, upper=1.5),
    ),
    motion=Motion(
        displacement=psi,
        velocity=w,
        stiffness=k_c,
        damping=k_d,
        drive_gain=b * k_tau / r_0,
        rest=psi_off,
        bias=sp.Integer(0),
        inertia=J_z,
    ),
    lateral=ROLLING,
    units={"x": "rad", "force": "N m", "input": "A", "time": "s", "length": "m"},
    dynamics_name="yaw_dynamics",
)


def creep_factor(delta_0: float, r_0: float, b: float) -> float:
    """Return c_y of (2.12) for the equivalent conicity `delta_0` [rad], wheel radius and track width [m]."""
    return math.cos(delta_0) ** 2 - 2.0 * r_0 / b * math.sin(delta_0) * math.cos(delta_0)


def conicity(c_y: float, r_0: float, b: float) -> float:
    """Return the positive delta_0 [rad] that gives `c_y` by (2.12).

    Raises
    ------
    InputError
        If no conicity in (0, pi/2) gives this creep factor: c_y must lie below 1.
    """
    lowest = math.pi / 2
    if not creep_factor(lowest, r_0, b) - 1e-12 <= c_y < 1.0:
        raise InputError(
            f"No positive conicity gives c_y = {c_y:g}; c_y must lie in [0, 1). Give c_y itself instead of delta_0."
        )
    return float(brentq(lambda delta: creep_factor(delta, r_0, b) - c_y, 0.0, math.atan2(b, 2.0 * r_0)))
