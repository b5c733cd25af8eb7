"""Smooth equations of a structure between two kinks, and conditions for reaching the next kink.

Every ``Abs``, ``sign`` and ``positive_part`` becomes a number that is frozen until its argument changes sign; a state with a
limit is either free or held at an end of its range.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from rigsight.effects.symbols import positive_part
from rigsight.simulate import Structure
from rigsight.simulate.equations.structure import INPUT, TIME

_KINKS = (sp.Abs, sp.sign, positive_part)
_TORQUE = sp.Symbol("disturbing_torque", real=True)
_Magnitude = sp.Function("fabs", real=True)
"""The absolute value under a non-integer power: its sign must not be frozen, since a power of a negative number is undefined."""


@dataclass(frozen=True)
class SwitchedEquations:
    """A structure with numbers in it, as functions of plain floats.

    Every function takes time, input, disturbing torque, the states, the frozen signs (-1 or 1), and for each limited state
    1 while it is free and 0 while it is held.

    Attributes
    ----------
    rates
        Rates of all states.
    arguments
        What each frozen sign is the sign of, inner ones first.
    driven
        Rate that each limited state would have without its limit.
    outputs
        The rig's outputs, of time and the states alone, for arrays.
    n_signs
        Number of frozen signs.
    limited, limits
        Indices of the limited states, and the half-widths of their ranges.
    velocity, velocity_sign
        Index of the velocity among the states, and of its sign among the signs (None if nothing depends on it).
    delay, reading_delay
        Dead times of input and of the first output's sensor [s].
    """

    rates: Callable[..., list[float]]
    arguments: Callable[..., list[float]]
    driven: Callable[..., list[float]]
    outputs: Callable[..., Any]
    n_signs: int
    limited: tuple[int, ...]
    limits: tuple[float, ...]
    velocity: int
    velocity_sign: int | None
    delay: float
    reading_delay: float


def switched_equations(structure: Structure, values: Mapping[str, float]) -> SwitchedEquations:
    """Return the equations of a driven structure with all numbers put in."""
    assert structure.velocity_index is not None
    assert structure.rig.motion.inertia is not None
    numbers = {
        s: _number(values[name]) for s, name in zip(structure.parameter_symbols, structure.names, strict=True)
    }
    by_name = dict(zip(structure.names, structure.parameter_symbols, strict=True))
    inertia = structure.rig.motion.inertia
    inertia = inertia.xreplace({s: by_name[s.name] for s in inertia.free_symbols})

    limited = [i for i, equation in enumerate(structure.equations) if equation.limit is not None]
    free = sp.symbols(f"free0:{len(limited)}", real=True)
    ends = {}
    for i, switch in zip(limited, free, strict=True):
        equation = structure.equations[i]
        assert equation.limit is not None
        reached = sp.sign(equation.symbol * sp.sign(equation.rate) - equation.limit)
        ends[reached] = 1 - 2 * switch

    def bound(expression: sp.Expr) -> sp.Expr:
        return expression.xreplace(ends).xreplace(numbers)

    driven = [bound(structure.equations[i].rate) for i in limited]
    rates = [bound(equation.rate) for equation in structure.equations]
    rates[structure.velocity_index] += _TORQUE / inertia.xreplace(numbers)
    for i, switch, rate in zip(limited, free, driven, strict=True):
        rates[i] = rate * switch

    freezer = _Freezer()
    rates = [freezer.frozen(rate) for rate in rates]
    driven = [freezer.frozen(rate) for rate in driven]
    names = [TIME, INPUT, _TORQUE, *structure.states, *freezer.signs, *free]
    velocity = structure.states[structure.velocity_index]
    return SwitchedEquations(
        rates=_function(names, rates),
        arguments=_function(names, freezer.arguments),
        driven=_function(names, driven),
        outputs=_function(
            [TIME, *structure.states], [bound(output) for output in structure.outputs], "numpy"
        ),
        n_signs=len(freezer.signs),
        limited=tuple(limited),
        limits=tuple(_limit(structure, i, numbers) for i in limited),
        velocity=structure.velocity_index,
        velocity_sign=freezer.arguments.index(velocity) if velocity in freezer.arguments else None,
        delay=0.0 if structure.delay is None else float(structure.delay.xreplace(numbers)),
        reading_delay=0.0
        if structure.first_shown_late is None
        else float(structure.first_shown_late.xreplace(numbers)),
    )


def _number(value: float) -> sp.Expr:
    """Return whole numbers as such: an exponent of exactly 1 leaves no power behind."""
    return sp.Integer(int(value)) if float(value).is_integer() and abs(value) < 100 else sp.Float(value)


def _limit(structure: Structure, index: int, numbers: Mapping[sp.Symbol, sp.Expr]) -> float:
    limit = structure.equations[index].limit
    assert limit is not None
    return float(limit.xreplace(numbers))


def _function(
    names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr], modules: str = "math"
) -> Callable[..., list[Any]]:
    # Valid Python names that are the same in every run, so that sums are evaluated in the same order.
    own = {name: sp.Symbol(f"a{i:03d}", real=True) for i, name in enumerate(names)}
    bound = [sp.sympify(expression).xreplace(own) for expression in expressions]
    return sp.lambdify(list(own.values()), bound, modules=modules, cse=True)  # type: ignore[no-any-return]


class _Freezer:
    """Replaces kinks by frozen signs, inner ones first, and collects what they are the signs of."""

    def __init__(self) -> None:
        self.arguments: list[sp.Expr] = []
        self.signs: list[sp.Symbol] = []

    def frozen(self, expression: sp.Expr) -> sp.Expr:
        """Return the expression without kinks."""
        expression = expression.replace(
            lambda e: isinstance(e, sp.Pow) and isinstance(e.base, sp.Abs) and not e.exp.is_Integer,
            lambda e: sp.Pow(_Magnitude(e.base.args[0]), e.exp),
        )
        while True:
            # Sets are unordered, and sums of floats depend on the order.
            kinks = sorted(expression.atoms(*_KINKS), key=sp.default_sort_key)
            innermost = [e for e in kinks if not e.args[0].atoms(*_KINKS)]
            if not innermost:
                return expression
            expression = expression.xreplace({e: self._replacement(e) for e in innermost})

    def _replacement(self, kink: sp.Expr) -> sp.Expr:
        argument = kink.args[0]
        sign = self._sign(argument)
        if isinstance(kink, sp.sign):
            return sign
        if isinstance(kink, sp.Abs):
            return sign * argument
        return argument * (1 + sign) / 2

    def _sign(self, argument: sp.Expr) -> sp.Expr:
        if -argument in self.arguments:
            return -self.signs[self.arguments.index(-argument)]
        if argument not in self.arguments:
            self.arguments.append(argument)
            self.signs.append(sp.Symbol(f"sign{len(self.signs)}", real=True))
        return self.signs[self.arguments.index(argument)]
