"""At which state does a rig start and rest: declared values, else balance of forces with friction and memory; can it drift?"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from scipy.linalg import null_space
from scipy.optimize import least_squares

from rigsight.effects import Place
from rigsight.effects.symbols import derivative, v
from rigsight.records.record import Floats
from rigsight.rigs import Rig
from rigsight.simulate.compiled.kernel import kernel_of
from rigsight.simulate.equations.composition import compose
from rigsight.simulate.equations.kinks import FrozenStructure, freeze, is_zero
from rigsight.simulate.equations.structure import TIME, Structure, input_symbols
from rigsight.simulate.input_hold import HeldInput, hold_input
from rigsight.simulate.printing.language import limited

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

BALANCED = 1e-8
"""Imbalance of forces allowed at the end of the search, relative to that at its start."""
PATH_STEPS = 32
"""Steps in which the inputs rise if hysteresis depends on the path; the error is some 3 % of the force that it holds."""
_HUGE = 1e100
"""Replaces infinity, because its square is still finite."""
_PRECISE = 1e-15
"""Change of cost, point and slope at which the search ends, close to the precision of floating-point numbers."""

_DRAWS = 3
_SINGULAR = 1e-9
"""Singular value of the scaled stiffness, relative to the largest, below which it counts as zero."""


def rest_state(structure: Structure, p: Floats, held: HeldInput) -> Floats:
    """Return the states at the start of a record, shape (n_states,): declared ones, and all others in equilibrium with them.

    This is the equilibrium under the first sample of the inputs, reached from rest with empty memories: the inputs are raised
    slowly from zero, so that hysteresis and friction hold the same forces as on a rig. A rig without a spring has no equilibrium
    and starts at its rest position.
    """
    states, initial = structure.states, structure.rig.mechanism.initial.items()
    given = {states.index(own): _value(structure, p, value) for own, value in initial if own in states}
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


def _risen(structure: Structure, p: Floats, held: HeldInput) -> Floats:
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


def _value(structure: Structure, p: Floats, expression: sp.Expr) -> float:
    """Return the value of an expression in the rig's own symbols."""
    return float(expression.subs({s: p[structure.names.index(s.name)] for s in expression.free_symbols}))


def _quiet_parameters(structure: Structure, p: Floats, critical_damping: float) -> Floats:
    """Return parameters with the same equilibria, but with critical damping and without delays and disturbances."""
    # An overshoot of the equilibrium would leave a memory in hysteresis and friction that a rig at rest does not have.
    quiet = p.copy()
    damping = structure.names.index(structure.rig.motion.damping.name)
    quiet[damping] = max(p[damping], critical_damping)
    for effect in structure.effects:
        silent = dict(effect.null_values()) if effect.delay is not None else {}
        if effect.place is Place.DISTURBANCE:
            silent |= {parameter.name: 0.0 for parameter in effect.parameters}
        for own_name, value in silent.items():
            name = structure.parameter_name(effect, own_name)
            if name in structure.names:
                quiet[structure.names.index(name)] = value
    return quiet


def _settled(
    structure: Structure, p: Floats, state: Floats, ramp: tuple[float, float], duration: float
) -> Floats | None:
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


def equilibrium(
    structure: Structure, p: Floats, inputs: Floats, given: Mapping[int, float] | None = None
) -> Floats:
    """Return the static equilibrium reached from rest under slowly rising inputs, with dry friction and hysteresis."""
    # Without inputs the rig rests where its springs and weights are in balance without friction. From there, friction holds a
    # joint until it is overcome. States on which no force acts stay at zero, and so do all states if there is no equilibrium.
    # M. Jean, Comput. Methods Appl. Mech. Eng. 177 (1999) 235, for steps with multipliers instead of friction signs.
    balance = _balance_of(structure)
    given = dict(given or {})
    state = np.zeros(len(structure.states))
    state[list(given)] = list(given.values())
    n_steps = PATH_STEPS if balance.remembers else 1
    without = np.array(p, dtype=np.float64)
    for index, null in balance.one_sided.items():
        without[index] = null
    state = _reached(balance, without, 0.0 * inputs, state, given, with_friction=False)
    if np.any(inputs != 0.0):
        for step in range(1, n_steps + 1):
            state = _reached(balance, p, inputs * (step / n_steps), state, given, with_friction=True)
    return state


@dataclass(frozen=True)
class _Balance:
    """Residuals of the equilibrium, as functions of (parameters, inputs, states, previous states, friction signs)."""

    rates: Callable[..., Any]  # balance of each state that can be unknown, shape (n_unknown,)
    # Motion of the joints with dry friction since the previous states, shape (n_frictions,).
    turned: Callable[..., Any]
    unknown: tuple[int, ...]  # indices of the states that can be unknown: all but the velocities
    n_frictions: int  # number of joints with dry friction
    remembers: bool  # whether there are hysteresis states, which depend on the path and not on the forces
    # Null values, by parameter index, of directional friction, which would otherwise exert a force at sign
    # zero.
    one_sided: Mapping[int, float]


def _reached(
    balance: _Balance,
    p: Floats,
    inputs: Floats,
    before: Floats,
    given: Mapping[int, float],
    *,
    with_friction: bool,
) -> Floats:
    """Return the equilibrium under the inputs closest to the previous states, or these if there is none."""
    free = [i for i, index in enumerate(balance.unknown) if index not in given]
    places = [balance.unknown[i] for i in free]
    n = len(places)
    signs = np.zeros(balance.n_frictions)
    slides = np.zeros(balance.n_frictions)

    def states_of(y: Floats) -> Floats:
        state = before.copy()
        state[places] = y[:n]
        return state

    def missing(y: Floats) -> Floats:
        state = states_of(y)
        # A power of a memory that is zero may divide by zero; its factor is then zero as well.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            rates = np.asarray(balance.rates(p, inputs, state, before, y[n:]), dtype=np.float64)[free]
        rates = np.nan_to_num(rates, nan=0.0, posinf=_HUGE, neginf=-_HUGE)
        turned = np.asarray(balance.turned(p, inputs, state, before, y[n:]), dtype=np.float64)
        held = np.where(slides == 0.0, turned, y[n:] - slides) if with_friction else y[n:]
        return np.concatenate([rates, held])

    start = np.r_[before[places], signs]
    if start.size == 0:
        return before
    # Stick or slide: a joint whose multiplier exceeds 1 slides, one that slid backwards sticks.
    for _ in range(3 * balance.n_frictions + 1):
        found = least_squares(missing, start, x_scale="jac", ftol=_PRECISE, xtol=_PRECISE, gtol=_PRECISE)
        turned = np.asarray(
            balance.turned(p, inputs, states_of(found.x), before, found.x[n:]), dtype=np.float64
        )
        loose = np.where(np.abs(found.x[n:]) > 1.0 + BALANCED, np.sign(found.x[n:]), 0.0)
        wanted = np.where(slides == 0.0, loose, np.where(turned * slides >= 0.0, slides, 0.0))
        if not with_friction or np.array_equal(wanted, slides):
            break
        slides = wanted
    left, first = np.linalg.norm(missing(found.x)), np.linalg.norm(missing(start))
    return states_of(found.x) if left <= BALANCED * first else before


@lru_cache(maxsize=256)
def _balance_of(structure: Structure) -> _Balance:
    frozen = freeze(structure)
    signs = frozen.friction_signs(structure)
    before = [sp.Symbol(f"before {i}", real=True) for i in range(len(structure.states))]
    residuals, memories = residuals_at_rest(structure, before, limited, signs)
    turned = [speed.xreplace(_moved(structure, before)) for speed in frozen.speeds(structure)]
    inputs = [input_symbols(i)[0] for i in range(len(structure.rig.inputs))]
    multipliers = [FrozenStructure.friction_sign(i) for i in range(len(frozen.frictions))]
    arguments = [list(structure.parameter_symbols), inputs, list(structure.states), before, multipliers]
    functions = [
        {"positive_part": lambda x: max(x, 0.0), "limited": lambda x, end: min(max(x, -end), end)},
        "numpy",
    ]
    return _Balance(
        rates=sp.lambdify(arguments, list(residuals.values()), functions),
        turned=sp.lambdify(arguments, turned, functions),
        unknown=tuple(residuals),
        n_frictions=len(frozen.frictions),
        remembers=bool(memories),
        one_sided=_one_sided(structure),
    )


def _one_sided(structure: Structure) -> dict[int, float]:
    """Return the indices of the parameters of directional friction, each with its null value."""
    place = {name: i for i, name in enumerate(structure.names)}
    found: dict[int, float] = {}
    for effect in structure.effects:
        if effect.torque is None:
            continue
        signs = {atom for atom in effect.torque.atoms(sp.sign) if atom.args[0] == v}
        push = effect.torque.xreplace(dict.fromkeys(signs, sp.Integer(0)))
        numbers = {sp.Symbol(p.name, real=True) for p in effect.parameters}
        if signs and push != 0 and push.free_symbols <= numbers:
            for p in effect.parameters:
                if p.null is not None:
                    found[place[structure.parameter_name(effect, p.name)]] = p.null
    return found


def residuals_at_rest(
    structure: Structure,
    before: Sequence[sp.Expr],
    within: Callable[[sp.Expr, sp.Expr], sp.Expr],
    signs: Mapping[sp.Expr, sp.Expr] | None = None,
) -> tuple[dict[int, sp.Expr], set[int]]:
    """Return what is zero at rest for each state but the velocities, by index, and the indices of memories."""
    # It is what a coordinate lacks of balance, the rate of a state, or what a memory, which nothing moves at rest, has of the way
    # from the states before; `within` limits that to its range.
    motion = structure.tree.motion
    n, still = len(motion.coordinates), {**_steady(structure), **dict.fromkeys(motion.velocities, sp.S.Zero)}
    lacking = (missing.xreplace(signs or {}).xreplace(still) for missing in structure.out_of_balance)
    found, memories = dict(enumerate(lacking)), set()
    for index, equation in enumerate(structure.equations[2 * n :], 2 * n):
        found[index] = equation.rate.xreplace(still)
        if is_zero(found[index]):
            memories.add(index)
            reached = before[index] + equation.rate.xreplace(_moved(structure, before))
            found[index] = equation.symbol - (
                reached if equation.limit is None else within(reached, equation.limit)
            )
    return found, memories


def _steady(structure: Structure) -> dict[sp.Expr, sp.Expr]:
    """Return zeros for time and the rates of inputs."""
    rising = [symbol for i in range(len(structure.rig.inputs)) for symbol in input_symbols(i)[1:]]
    return dict.fromkeys((*rising, TIME), sp.S.Zero)


def _moved(structure: Structure, before: Sequence[sp.Expr]) -> dict[sp.Expr, sp.Expr]:
    """Return the velocities over a step of unit time under steady inputs: differences of coordinates."""
    motion = structure.tree.motion
    pairs = zip(motion.velocities, motion.coordinates, before, strict=False)
    return {**_steady(structure), **{velocity: now - then for velocity, now, then in pairs}}


def can_drift(rig: Rig, known: Mapping[str, float]) -> bool:
    """Return True if a rig can rest at different positions under the same force, and a sensor shows the difference."""
    structure = compose(rig)
    motion = structure.tree.motion
    if not motion.coordinates:
        return False
    states = [equation.symbol for equation in structure.equations if equation.symbol not in motion.velocities]
    rates = [*structure.out_of_balance, *(e.rate for e in structure.equations[2 * len(motion.coordinates) :])]
    still = {*motion.velocities, *_steady(structure)}
    shown = list(structure.outputs)
    if structure.elimination is not None:
        # Without velocities and input rates the forces are short; otherwise their slopes would be too long.
        zero = dict.fromkeys(still, sp.S.Zero)
        rates, shown = ([e.xreplace(zero) for e in own] for own in (rates, shown))
    slopes = sp.Matrix([[derivative(e, state) for state in states] for e in (*rates, *shown)])
    symbols = sorted(slopes.free_symbols, key=str)
    function = sp.lambdify(symbols, slopes, [{"positive_part": lambda x: np.maximum(x, 0.0)}, "numpy"])
    rng = np.random.default_rng(0)
    defaults = {p.name: p.default for p in (*rig.constants, *rig.parameters) if p.default is not None}
    values = {f"parameter {name}": value for name, value in {**defaults, **known}.items()}
    for _ in range(_DRAWS):
        numbers = [
            0.0 if symbol in still else values.get(str(symbol), float(rng.uniform(0.2, 0.8)))
            for symbol in symbols
        ]
        with np.errstate(all="ignore"):
            matrix = np.asarray(function(*numbers), dtype=np.float64)
        if not np.all(np.isfinite(matrix)):
            continue
        balance, seen = matrix[: len(rates)], matrix[len(rates) :]
        size = np.linalg.norm(balance, axis=0)
        size[size == 0.0] = 1.0
        free = null_space(balance / size, rcond=_SINGULAR)
        if not np.any(np.abs((seen / size) @ free) > _SINGULAR * np.max(np.abs(seen), initial=1.0)):
            return False
    return True
