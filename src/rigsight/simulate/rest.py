"""Default initial state of a record: the start values of the rig, else static equilibrium."""

from __future__ import annotations

import math

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import Place
from rigsight.rigs import Rig
from rigsight.simulate.compiled.kernel_cache import kernel_of
from rigsight.simulate.equations.structure import Structure
from rigsight.simulate.equilibrium import equilibrium
from rigsight.simulate.input_hold import HeldInput, hold_input

RAMP_PERIODS = 20.0
"""Length of the slow rise of the input in periods of the linear rig."""
INTERVALS = 100
"""Number of pieces of the rise, and of the first wait."""
SETTLED = 1e-9
"""Relative change of the states during one wait below which they are at rest."""
WAITS = 7
"""Each wait is twice as long as the one before."""
TOLERANCE = 1e-9
"""Error allowed per step, relative to the largest excursion of each state."""


def rest_state(structure: Structure, p: NDArray[np.float64], held: HeldInput) -> NDArray[np.float64]:
    """Return the states at the start of a record: those that the rig declares, and all others in static equilibrium with them.

    This is the equilibrium under the first sample of the inputs, reached from rest with empty memories: the inputs are raised
    slowly from zero, so that hysteresis and friction hold the same forces as on a rig. A rig without a spring has no equilibrium
    and starts at its rest position.

    Parameters
    ----------
    structure
        Rig and effects.
    p
        Parameter values in the order of the structure, shape (n_parameters,).
    held
        Input between its samples.

    Returns
    -------
    Shape (n_states,).
    """
    states = structure.states
    given = {
        states.index(symbol): _value(structure, p, value)
        for symbol, value in structure.rig.mechanism.initial.items()
        if symbol in states
    }
    moving = {states.index(rate) for rate in structure.tree.motion.velocities}
    if has_raisable_damping(structure.rig) and not set(given) - moving:
        state = _risen(structure, p, held)
    else:
        inputs = held.coefficients.reshape(held.n_pieces + 1, -1, 4)[0, : len(structure.rig.inputs), 0]
        state = equilibrium(structure, p, inputs, given)
    state[list(given)] = list(given.values())
    return state


def has_raisable_damping(rig: Rig) -> bool:
    """Return True for a rig with one motion whose damping is a parameter of its own, so that a slow rise can be simulated."""
    return rig.has_one_motion and (rig.motion.inertia is None or isinstance(rig.motion.damping, sp.Symbol))


def _risen(structure: Structure, p: NDArray[np.float64], held: HeldInput) -> NDArray[np.float64]:
    """Return the state in which a rig with one motion rests after a slow rise of its input, simulated with high damping."""
    state = np.zeros(max(1, len(structure.states)))
    motion = structure.rig.motion
    if motion.inertia is None:
        return state
    inertia = _value(structure, p, motion.inertia)
    stiffness = _value(structure, p, motion.stiffness)
    state[0] = _value(structure, p, motion.rest)
    if stiffness <= 0.0:
        return state
    period = 2.0 * math.pi * math.sqrt(inertia / stiffness)
    quiet = _quiet_parameters(structure, p, critical_damping=2.0 * math.sqrt(stiffness * inertia))
    first = float(held.coefficients.reshape(held.n_pieces + 1, -1)[0, 0])
    for start, stop in ((0.0, 0.0), (0.0, first)) if first != 0.0 else ((0.0, 0.0),):
        reached = _settled(structure, quiet, state, (start, stop), RAMP_PERIODS * period)
        if reached is None:
            return state
        state = reached
    return state


def _value(structure: Structure, p: NDArray[np.float64], expression: sp.Expr) -> float:
    """Return the value of an expression in the rig's own symbols."""
    return float(expression.subs({s: p[structure.names.index(s.name)] for s in expression.free_symbols}))


def _quiet_parameters(
    structure: Structure, p: NDArray[np.float64], critical_damping: float
) -> NDArray[np.float64]:
    """Return parameters with the same equilibria, but with critical damping and without delays and disturbances.

    An overshoot of the equilibrium would leave a memory in hysteresis and friction that a rig at rest does not have.
    """
    quiet = p.copy()
    damping = structure.names.index(structure.rig.motion.damping.name)
    quiet[damping] = max(p[damping], critical_damping)
    for effect in structure.effects:
        if effect.delay is not None:
            for own_name, null in effect.null_values().items():
                name = structure.parameter_name(effect, own_name)
                if name in structure.names:
                    quiet[structure.names.index(name)] = null
        if effect.place is Place.DISTURBANCE:
            for parameter in effect.parameters:
                name = structure.parameter_name(effect, parameter.name)
                if name in structure.names:
                    quiet[structure.names.index(name)] = 0.0
    return quiet


def _settled(
    structure: Structure,
    p: NDArray[np.float64],
    state: NDArray[np.float64],
    ramp: tuple[float, float],
    duration: float,
) -> NDArray[np.float64] | None:
    """Return the state after a ramp of the input and waits until all states are at rest; None if the simulation fails."""
    velocity = structure.velocity_index or 0
    interval = duration / INTERVALS
    samples = np.linspace(*ramp, INTERVALS + 1)
    state = state.copy()
    for wait in range(WAITS):
        before = state.copy()
        held = hold_input(samples, interval, "foh")
        status, _, state = kernel_of(structure).simulate_one(held, p, state, TOLERANCE, samples.size)
        if status != 0:
            return None
        moved = np.abs(state - before)
        moved[velocity] = 0.0
        if np.all(moved <= SETTLED * np.abs(state)):
            break
        samples = np.full(INTERVALS * 2**wait + 1, ramp[1])
    state[velocity] = 0.0
    return state
