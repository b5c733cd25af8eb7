"""Lateral creep factor from the conicity of a wheel set, as declared in the file of the running gear (2.12)."""

from __future__ import annotations

import sympy as sp

from rigsight.effects.symbols import derivative
from rigsight.rigs.built_in import RUNNING_GEAR
from rigsight.rigs.evaluation import evaluated

(_CREEP_FACTOR,) = (a.value for a in RUNNING_GEAR.alternatives if a.parameter.name == "delta_0")
_SLOPE = derivative(_CREEP_FACTOR, sp.Symbol("delta_0", real=True))


def creep_factor(delta_0: float, r_0: float, b: float) -> float:
    """Return c_y of (2.12) for the equivalent conicity `delta_0` [rad], wheel radius and track width [m]."""
    return evaluated(_CREEP_FACTOR, {"delta_0": delta_0, "r_0": r_0, "b": b})


def conicity_slope(delta_0: float, r_0: float, b: float) -> float:
    """Return dc_y / d delta_0 [1/rad] of (2.12)."""
    return evaluated(_SLOPE, {"delta_0": delta_0, "r_0": r_0, "b": b})
