"""What would a controller put out with an effect? Of its signals along a record, without a simulation of the rig."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.signal import lfilter

from rigsight.effects import Effect, State
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.identify.rig_equations import FUNCTIONS
from rigsight.rigs import Controller

Floats = NDArray[np.float64]

_SUBSTEPS = 4
"""Steps in the time constant of a state that follows a nonlinear law."""
_OF_NUMBERS = {"positive_part": lambda x: max(x, 0.0)}
"""Kinks of single numbers, many times as fast as those of arrays."""
_READ = (canonical.output, canonical.error, canonical.command)


@dataclass(frozen=True)
class ControllerSignals:
    """Signals of a controller along a record, shape (n_samples,) each, see `rigsight.rigs.Controller`."""

    output: Floats
    error: Floats
    command: Floats


def limits_of(law: Controller, numbers: Mapping[str, float]) -> Callable[[Floats], Floats]:
    """Return the signal of a drive as a function of the output of its controller."""
    known = {sp.Symbol(name, real=True): value for name, value in numbers.items()}
    limited = _compiled(law.limited(canonical.output).xreplace(known), (canonical.output,))
    return lambda output: np.asarray(limited(output), dtype=np.float64)


def changed_output(effect: Effect, own: Mapping[str, float], signals: ControllerSignals, dt: float) -> Floats:
    """Return the output of a controller with an effect, shape (n_samples,).

    Parameters
    ----------
    effect
        Of a controller.
    own
        Its parameters by their own names.
    signals
        Of the controller without it.
    dt
        Sample time [s].
    """
    parts, symbols = (signals.output, signals.error, signals.command), _symbols(own)
    if effect.command_delay is not None:
        late = float(_compiled(effect.command_delay, symbols)(*own.values()))
        rows = np.arange(signals.command.size, dtype=np.float64)
        followed = np.interp(rows - late / dt, rows, signals.command)
        return np.asarray(signals.output - signals.command + followed)
    courses = [_course(state, own, parts, dt) for state in effect.states]
    law = effect.control
    if law is None:
        law = canonical.output - canonical.command + effect.command
    arguments = (*(state.symbol for state in effect.states), *_READ, *symbols)
    changed = _compiled(law, arguments)(*courses, *parts, *own.values())
    return np.array(np.broadcast_to(changed, signals.output.shape), dtype=np.float64)


def _course(
    state: State, own: Mapping[str, float], parts: tuple[Floats, Floats, Floats], dt: float
) -> Floats:
    """Return a state along a record; it begins where it would stay at the first sample, or at zero."""
    symbols, numbers = _symbols(own), own.values()
    slope = _slope(state.rate, state.symbol)
    if not slope.free_symbols <= set(symbols):
        function = _compiled(state.rate, (state.symbol, *_READ, *symbols), of_numbers=True)
        return _stepped(function, parts, dt, own)
    s = float(_compiled(slope, symbols)(*numbers))
    rate = _compiled(state.rate, (state.symbol, *_READ, *symbols))(0.0, *parts, *numbers)
    push = np.broadcast_to(rate, parts[0].shape)
    if s == 0.0:
        return np.concatenate([[0.0], np.cumsum(0.5 * dt * (push[1:] + push[:-1]))])
    kept = np.exp(s * dt)
    # The integral of exp(s (dt - t)) times the two ends of a push that is linear between samples.
    of_end = (kept - 1.0 - s * dt) / (s**2 * dt)
    of_begin = (kept - 1.0) / s - of_end
    gained = of_begin * push[:-1] + of_end * push[1:]
    later, _ = lfilter([1.0], [1.0, -kept], gained, zi=[kept * -push[0] / s])
    return np.concatenate([[-push[0] / s], later])


def _stepped(
    rate: Callable[..., float], parts: tuple[Floats, Floats, Floats], dt: float, own: Mapping[str, float]
) -> Floats:
    """Return a state that follows the command by a nonlinear law, in steps of a part of the shortest time of this law."""
    steps, numbers = _SUBSTEPS * max(1, int(np.ceil(dt / min(own.values())))), tuple(own.values())
    rows = list(zip(*(part.tolist() for part in parts), strict=True))
    value, course = rows[0][-1], []
    for row in rows:
        course.append(value)
        for _ in range(steps):
            value += dt / steps * rate(value, *row, *numbers)
    return np.array(course)


def _symbols(own: Mapping[str, float]) -> tuple[sp.Symbol, ...]:
    return tuple(sp.Symbol(name, real=True) for name in own)


@lru_cache(maxsize=64)
def _slope(rate: sp.Expr, state: sp.Symbol) -> sp.Expr:
    return derivative(rate, state)


@lru_cache(maxsize=256)
def _compiled(
    expression: sp.Expr, arguments: tuple[sp.Symbol, ...], of_numbers: bool = False
) -> Callable[..., Any]:
    modules = [_OF_NUMBERS, "math"] if of_numbers else [FUNCTIONS, "numpy"]
    compiled: Callable[..., Any] = sp.lambdify(arguments, expression, modules)
    return compiled
