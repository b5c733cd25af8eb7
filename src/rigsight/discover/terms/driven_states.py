"""States of an effect along a measured motion, if they depend on it linearly.

Rates that are linear in states and signals, with coefficients that depend only on parameters, form a linear filter: its step from
sample to sample is exact for the hold of the record, and the same code works for every effect of this kind.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Literal

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter, ss2tf

from rigsight.discover.motion import Motion
from rigsight.effects import Effect
from rigsight.effects import symbols as canonical

_SIGNALS = (canonical.x, canonical.v, canonical.u)
"""Signals of a motion that are known at every sample."""

Filter = tuple[sp.Matrix, sp.Matrix]
"""Rates per unit of each state, and per unit of each signal."""


@lru_cache(maxsize=256)
def linear_filter(effect_states: tuple[tuple[sp.Symbol, sp.Expr], ...]) -> Filter | None:
    """Return the linear filter that these rates describe; None if they are not linear."""
    own = [symbol for symbol, _ in effect_states]
    rates = sp.Matrix([rate for _, rate in effect_states])
    of_states, of_signals = rates.jacobian(own), rates.jacobian(_SIGNALS)
    left = (rates - of_states * sp.Matrix(own) - of_signals * sp.Matrix(_SIGNALS)).applyfunc(sp.simplify)
    varying = (of_states.free_symbols | of_signals.free_symbols) & {*own, *_SIGNALS, canonical.t}
    return None if varying or any(left) else (of_states, of_signals)


def is_filter(effect: Effect) -> bool:
    """Return True if an effect's states depend linearly on displacement, velocity and input, and have no limit."""
    if not effect.states or any(state.limit is not None for state in effect.states):
        return False
    own = {state.symbol for state in effect.states}
    parameters = {sp.Symbol(p.name, real=True) for p in effect.parameters}
    known = own | parameters | set(_SIGNALS)
    if not all(state.rate.free_symbols <= known for state in effect.states):
        return False
    return linear_filter(_rates(effect)) is not None


def states_along(
    effect: Effect, values: Mapping[str, float], motion: Motion
) -> dict[str, NDArray[np.float64]]:
    """Return the states of a filter along a motion by name, shape (n_samples,) each.

    They start in equilibrium with the first sample of each signal.
    """
    found = linear_filter(_rates(effect))
    assert found is not None
    numbers = {sp.Symbol(name, real=True): value for name, value in values.items()}
    rates, drive = (np.array(part.subs(numbers), dtype=np.float64) for part in found)
    n = len(effect.states)
    states = np.zeros((motion.x.size, n))
    for column, signal in enumerate((motion.x, motion.v, motion.u)):
        if not np.any(drive[:, column]):
            continue
        held: Literal["zoh", "foh"] = "zoh" if signal is motion.u and motion.record.hold == "zoh" else "foh"
        system = rates, drive[:, [column]], np.eye(n), np.zeros((n, 1))
        numerators, denominator = ss2tf(*cont2discrete(system, motion.dt, method=held)[:4])
        at_rest = np.linalg.solve(rates, -drive[:, column]) * signal[0]
        moved = [lfilter(numerator, denominator, signal - signal[0]) for numerator in numerators]
        states += at_rest + np.column_stack(moved)
    return {state.symbol.name: states[:, i] for i, state in enumerate(effect.states)}


def _rates(effect: Effect) -> tuple[tuple[sp.Symbol, sp.Expr], ...]:
    return tuple((state.symbol, state.rate) for state in effect.states)
