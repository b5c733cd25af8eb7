"""The symbols every effect's equation is written in, and the functions they share.

All kinks are written through ``Abs``, ``sign`` and `positive_part`: the simulation finds these atoms, freezes their sign between
events and so keeps its full order across them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp

_LEVELS_OFF = sp.Rational(1, 2)
"""Width over which a sigmoid levels off, in units of its knot."""

x = sp.Symbol("x", real=True)
"""Displacement from the rest position (psi - psi_off on the running gear)."""
v = sp.Symbol("v", real=True)
"""Velocity, the time derivative of `x`; at a drive that of the motion along which it acts."""
position = sp.Symbol("position", real=True)
"""Where a joint is, from the origin of its own motion; `x` is that less the rest position of its spring."""
acceleration = sp.Symbol("acceleration", real=True)
"""Time derivative of `v`, of a prescribed motion."""
load = sp.Symbol("load", real=True)
"""What a joint carries: the force of the drives along it less what its spring, weight and neighbors push along it."""
driven = sp.Symbol("driven", real=True)
"""Part of `load` that the drives push."""
damped = sp.Symbol("damped", real=True)
"""Force of a joint's own damper."""
u = sp.Symbol("u", real=True)
"""Input as it arrives at the effect (after the actuator effects in front of it)."""
output = sp.Symbol("output", real=True)
"""Output of a controller before the effect, in units of the signal of its drive; limits of this signal come later."""
error = sp.Symbol("error", real=True)
"""Output of a controller at standstill: proportional to goal less reading."""
command = sp.Symbol("command", real=True)
"""Part of the output of a controller that follows from the recorded input."""
t = sp.Symbol("t", real=True)
"""Time since the start of the record [s]."""
m = sp.Symbol("m", positive=True)
"""Inertia of the moving mass (J_z on the running gear)."""
k = sp.Symbol("k", real=True)
"""Stiffness of the spring (k_c on the running gear)."""
deflection = sp.Symbol("deflection", real=True)
"""Deflection that the spring sees: `x`, unless free play or backlash stands between."""
deflection_rate = sp.Symbol("deflection_rate", real=True)
"""Time derivative of `deflection`."""
spring_torque = sp.Symbol("spring_torque", real=True)
"""Torque (force) of the spring before the effect, ``k * deflection``."""
creepage = sp.Symbol("creepage", real=True)
"""What drives the lateral displacement: ``psi - (y - y_off) / (2 l_0)`` on the running gear."""
creep_gain = sp.Symbol("creep_gain", positive=True)
"""Lateral rate per creepage, ``v c_y``."""
lateral_displacement = sp.Symbol("lateral_displacement", real=True)
"""Lateral displacement from rest, ``y - y_off``."""
lateral_feedback = sp.Symbol("lateral_feedback", positive=True)
"""Creepage that a unit of lateral displacement takes away, ``1 / (2 l_0)``."""
reading = sp.Symbol("reading", real=True)
"""What an ideal sensor of the displacement would show."""

x_size = sp.Symbol("x_size", positive=True)
"""Size of the displacement in the records; in start values only."""
drive_size = sp.Symbol("drive_size", positive=True)
"""Size of the drive's force in the records; in start values only."""
input_size = sp.Symbol("input_size", positive=True)
"""Size of the drive's input in the records; in start values only."""
v_size = sp.Symbol("v_size", positive=True)
"""Size of the velocity in the records; in start values only."""
time_size = sp.Symbol("time_size", positive=True)
"""Reciprocal of the angular frequency of the motion [s]; in start values only."""


class positive_part(sp.Function):  # type: ignore[misc]  # noqa: N801
    """max(expression, 0)."""

    # A function of its own, because (e + Abs(e))/2 cancels: below a threshold it leaves rounding noise instead of zero, and
    # above a huge one nothing of a small signal.

    is_real = True

    def fdiff(self, argindex: int = 1) -> sp.Expr:  # noqa: ARG002
        """Return the slope: 0 below, 1 above."""
        return (1 + sp.sign(self.args[0])) / 2

    def _latex(self, printer: Any) -> str:
        return rf"\max\left(0,\ {printer.doprint(self.args[0])}\right)"


class _RealSign(sp.Function):  # type: ignore[misc]
    """Sign of a real number; the jump at zero has no slope."""

    is_real = True

    def fdiff(self, argindex: int = 1) -> sp.Expr:  # noqa: ARG002
        return sp.S.Zero


class _RealAbs(sp.Function):  # type: ignore[misc]
    """Magnitude of a real number."""

    is_real = True

    def fdiff(self, argindex: int = 1) -> sp.Expr:  # noqa: ARG002
        return _RealSign(self.args[0])


def derivative(expression: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    """Return the derivative of an expression of real numbers, without the impulse where a sign jumps.

    `sympy.diff` keeps the impulse, and does not differentiate a sign or magnitude whose argument could be infinite or complex:
    ``sign(x/a)``, because a could be 0, or ``Abs(x**n)``. Such results cannot be evaluated.
    """
    if not expression.has(sp.sign, sp.Abs, positive_part):
        return _slope(expression, symbol, {})
    real = expression.replace(sp.sign, _RealSign).replace(sp.Abs, _RealAbs)
    return (
        _slope(real, symbol, {})
        .replace(sp.sign, _RealSign)
        .replace(_RealSign, sp.sign)
        .replace(_RealAbs, sp.Abs)
    )


def _slope(expression: sp.Expr, symbol: sp.Symbol, known: dict[sp.Expr, sp.Expr]) -> sp.Expr:
    """Return the derivative of an expression, with those that are `known` of its parts."""
    # `sympy.diff` differentiates a part anew wherever it occurs; of an arm, whose joints carry one another, that is many times.
    if expression in known:
        return known[expression]
    parts, rule = expression.args, getattr(type(expression), "_eval_derivative", None)
    if not parts:
        found = sp.S.One if expression == symbol else sp.S.Zero
    elif isinstance(expression, sp.Add):
        found = sp.Add(*(_slope(part, symbol, known) for part in parts))
    elif isinstance(expression, sp.Mul):
        slopes = [_slope(part, symbol, known) for part in parts]
        found = sp.Add(
            *(sp.Mul(*parts[:i], own, *parts[i + 1 :]) for i, own in enumerate(slopes) if own != 0)
        )
    elif isinstance(expression, sp.Pow) and expression.exp.is_number:
        base, power = parts
        own = _slope(base, symbol, known)
        found = expression * (own * power / base) if own != 0 else sp.S.Zero
    elif rule is sp.Function._eval_derivative:
        slopes = [_slope(part, symbol, known) for part in parts]
        found = sp.Add(*(own * expression.fdiff(i) for i, own in enumerate(slopes, 1) if own != 0))
    else:
        found = sp.diff(expression, symbol)
    known[expression] = found
    return found


def rate_along(expression: sp.Expr, rates: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Return the time derivative of an expression, in which symbols change with the given rates."""
    present = [symbol for symbol in rates if symbol in expression.free_symbols]
    return sp.Add(*(derivative(expression, symbol) * rates[symbol] for symbol in present))


def beyond(expression: sp.Expr, half_width: sp.Expr) -> sp.Expr:
    """Return the part of `expression` that lies beyond [-half_width, half_width], zero inside."""
    return positive_part(expression - half_width) - positive_part(-expression - half_width)


def clamp(expression: sp.Expr, half_width: sp.Expr) -> sp.Expr:
    """Return `expression` limited to [-half_width, half_width]; exact for any half width, however large."""
    return expression - beyond(expression, half_width)


def sigmoid(signal: sp.Expr, knot: sp.Expr | float, side: int = 0) -> sp.Expr:
    """Return a smooth function of `signal` that grows by one up to a positive knot and stays there; zero at zero."""
    # Side 0: on both sides of zero, with the sign of the signal; 1 or -1: mainly where the signal has this sign.
    width = _LEVELS_OFF * knot

    def distance(place: sp.Expr | float) -> sp.Expr:
        return sp.sqrt((signal - place) ** 2 + width**2)

    if side == 0:
        return (distance(-knot) - distance(knot)) / (2 * knot)
    at_rest = width - knot * sp.sqrt(1 + _LEVELS_OFF**2)
    return side * (distance(0) - distance(side * knot) - at_rest) / (2 * knot)
