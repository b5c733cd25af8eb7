"""What would a controller put out with an effect? Of its signals along a record, without a simulation of the rig."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.signal import lfilter

from rigsight.effects import Effect, State
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.identify.rig_equations import FUNCTIONS

Floats = NDArray[np.float64]

_SUBSTEPS = 4
"""Steps in the time constant of a state that follows a nonlinear law."""
_OF_NUMBERS = {"positive_part": lambda x: max(x, 0.0), "sign": lambda x: (x > 0.0) - (x < 0.0)}
"""Kinks of single numbers, many times as fast as those of arrays."""
_READ = (canonical.output, canonical.error, canonical.command)


@dataclass(frozen=True)
class ControllerSignals:
    """Signals of a controller along a record, shape (n_samples,) each, see `rigsight.rigs.Controller`."""

    output: Floats
    error: Floats
    command: Floats


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
    numbers = {sp.Symbol(name, real=True): value for name, value in own.items()}
    if effect.command_delay is not None:
        rows, command = np.arange(signals.command.size, dtype=np.float64), signals.command
        late = float(effect.command_delay.xreplace(numbers))
        return np.asarray(signals.output - command + np.interp(rows - late / dt, rows, command))
    courses = [_course(state, numbers, signals, dt) for state in effect.states]
    symbols = tuple(state.symbol for state in effect.states)
    law = (
        effect.control
        if effect.control is not None
        else canonical.output - canonical.command + effect.command
    )
    changed = _compiled(law.xreplace(numbers), (*symbols, *_READ))(*courses, *_arrays(signals))
    return np.array(np.broadcast_to(changed, signals.output.shape), dtype=np.float64)


def _course(
    state: State, numbers: Mapping[sp.Symbol, float], signals: ControllerSignals, dt: float
) -> Floats:
    """Return a state along a record; it begins where it would stay at the first sample, or at zero."""
    rate = state.rate.xreplace(numbers)
    slope = derivative(rate, state.symbol)
    if not slope.is_number:
        function = sp.lambdify((state.symbol, *_READ), rate, [_OF_NUMBERS, "math"])
        return _stepped(function, signals, dt, min(numbers.values()))
    push = np.broadcast_to(
        _compiled(rate.xreplace({state.symbol: sp.S.Zero}), _READ)(*_arrays(signals)), signals.output.shape
    )
    if slope == 0:
        return np.concatenate([[0.0], np.cumsum(0.5 * dt * (push[1:] + push[:-1]))])
    s = float(slope)
    kept = np.exp(s * dt)
    # The integral of exp(s (dt - t)) times the two ends of a push that is linear between samples.
    of_end = (kept - 1.0 - s * dt) / (s**2 * dt)
    of_begin = (kept - 1.0) / s - of_end
    gained = of_begin * push[:-1] + of_end * push[1:]
    later, _ = lfilter([1.0], [1.0, -kept], gained, zi=[kept * -push[0] / s])
    return np.concatenate([[-push[0] / s], later])


def _stepped(rate: Callable[..., float], signals: ControllerSignals, dt: float, shortest: float) -> Floats:
    """Return a state that follows the command by a nonlinear law, in steps of a part of the shortest time of this law."""
    steps = _SUBSTEPS * max(1, int(np.ceil(dt / shortest)))
    rows = list(zip(*(own.tolist() for own in _arrays(signals)), strict=True))
    value, course = rows[0][-1], []
    for row in rows:
        course.append(value)
        for _ in range(steps):
            value += dt / steps * rate(value, *row)
    return np.array(course)


def _arrays(signals: ControllerSignals) -> tuple[Floats, Floats, Floats]:
    return signals.output, signals.error, signals.command


def _compiled(expression: sp.Expr, arguments: tuple[sp.Symbol, ...]) -> Callable[..., Floats]:
    compiled: Callable[..., Floats] = sp.lambdify(arguments, expression, [FUNCTIONS, "numpy"])
    return compiled
