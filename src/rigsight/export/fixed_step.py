"""What an export with an integrator of its own needs: its step, its start, constants that are computed once, and dry friction."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import sympy as sp

from rigsight.effects.symbols import derivative, rate_along
from rigsight.export.description import hold_text
from rigsight.export.equations import Exported
from rigsight.records.record import Floats
from rigsight.rigs import evaluated
from rigsight.simulate import Model, parameter_vector, rest_state, without_vanished_effects
from rigsight.simulate.equations.kinks import FrozenStructure, freeze
from rigsight.simulate.equations.straight_line import straight_line
from rigsight.simulate.equations.structure import TIME, Structure, input_rates, input_symbols
from rigsight.simulate.input_hold import HeldInput, hold_input, together

OSCILLATION = 0.03
"""Step times the angular frequency of the fastest oscillation: Runge-Kutta then errs by less than 1e-6 over its decay."""
SETTLING = 0.1
"""Step times the rate at which the fastest lag settles."""
LONGEST = 1e9
"""Step of a model without motion of its own [s]: the sample time alone decides."""
CAUTION = 0.4
"""Share of that step for nonlinear equations, whose time scales grow shorter with the motion."""
MIN_STEPS = 4
"""Steps per sample of a model with kinks or products, whose time scales depend on the motion."""
MIN_STEPS_PRESCRIBED = 32
"""The same if the motion is prescribed: the model has no time scale that requires more."""
_NUDGE = 1e-6


def internal_step(model: Model) -> float:
    """Return the longest internal step for a fixed-step integrator [s]."""
    # It follows from the eigenvalues about the rest position, with every kink to either side: what a stop or a play changes
    # is seen, what a smooth nonlinearity does at large motions is not.
    structure, values = without_vanished_effects(model.structure, model.values)
    if not structure.states:
        return LONGEST
    p = parameter_vector(structure, values)
    frozen = freeze(structure)
    rates = _rates(structure, frozen, p)
    rest, still = _rest(structure, p), np.zeros(len(_input_symbols(structure)))
    step, n_modes = LONGEST, len(frozen.modes)
    one_turned = np.vstack([np.ones(n_modes), np.ones((n_modes, n_modes)) - 2.0 * np.eye(n_modes)])
    for modes in (*one_turned, *-one_turned):
        jacobian = np.zeros((rest.size, rest.size))
        for i in range(rest.size):
            ahead, behind = rest.copy(), rest.copy()
            ahead[i] += _NUDGE
            behind[i] -= _NUDGE
            # On a side that a kink never has, a root or logarithm may have no real value.
            with np.errstate(all="ignore"):
                rise = np.array(rates(still, 0.0, ahead, modes)) - rates(still, 0.0, behind, modes)
            jacobian[:, i] = rise / (2.0 * _NUDGE)
        step = min(step, _of_eigenvalues(jacobian))
    return _rounded(step if is_linear(frozen, structure) else CAUTION * step)


def _rates(structure: Structure, frozen: FrozenStructure, p: Floats) -> Callable[..., list[float]]:
    """Return the rates as a function of inputs, time, states and modes."""
    kinks = {"absolute": np.abs, "positive_part": lambda value: np.maximum(value, 0.0)}
    inputs, modules = _input_symbols(structure), [kinks, "numpy"]
    if not frozen.steps:
        bound = dict(zip(structure.parameter_symbols, p, strict=True))
        rates: Callable[..., list[float]] = sp.lambdify(
            [inputs, TIME, structure.states, frozen.modes],
            [rate.xreplace(bound) for rate in frozen.rates],
            modules=modules,
        )
        return rates
    arguments = [*inputs, TIME, *structure.states, *frozen.modes, *structure.parameter_symbols]
    in_parts = straight_line(frozen.rates, frozen.steps).function(arguments, modules)
    return lambda u, time, x, modes: in_parts(*u, time, *x, *modes, *p)


def is_linear(frozen: FrozenStructure, structure: Structure) -> bool:
    """Return True if the rates have neither kinks nor products of states and inputs."""
    moving = {*structure.states, *_input_symbols(structure)}
    equations = list(frozen.rates)
    if structure.elimination is not None:
        motion = structure.tree.motion
        if any(structure.tree.flattened(mass).free_symbols & moving for mass in motion.mass):
            return False
        equations += map(structure.tree.flattened, motion.forces)
    return not frozen.modes and all(
        derivative(derivative(equation, a), b) == 0
        for equation in equations
        for a in moving & equation.free_symbols
        for b in moving & equation.free_symbols
    )


def _input_symbols(structure: Structure) -> list[sp.Symbol]:
    return [symbol for i in range(len(structure.rig.inputs)) for symbol in input_symbols(i)]


def _rest(structure: Structure, p: Floats) -> Floats:
    """Return the states about which time scales are read: at rest without input."""
    rest = np.zeros(len(structure.states))
    if not structure.rig.has_one_motion:
        return rest_state(structure, p, no_input(structure))
    if structure.rig.is_driven:
        rest[0] = evaluated(structure.rig.motion.rest, dict(zip(structure.names, p, strict=True)))
    return rest


def _of_eigenvalues(jacobian: Floats) -> float:
    if not np.all(np.isfinite(jacobian)):
        return LONGEST
    values = [value for value in np.linalg.eigvals(jacobian) if abs(value) > 1.0 / LONGEST]
    steps = ((OSCILLATION if abs(v.imag) > 0.1 * abs(v) else SETTLING) / abs(v) for v in values)
    return min(steps, default=LONGEST)


def _rounded(step: float) -> float:
    """Return two significant digits, rounded down: a number that a reader can remember and change."""
    if step >= LONGEST:
        return LONGEST
    scale = 10.0 ** (math.floor(math.log10(step)) - 1)
    return float(f"{math.floor(step / scale) * scale:.2g}")


def state_at_rest(exported: Exported) -> tuple[float, ...]:
    """Return the states at the static equilibrium without input, in order."""
    if exported.rest is None:
        return tuple(0.0 for _ in exported.states)
    rest = rest_state(exported.structure, np.array(exported.values), no_input(exported.structure))
    return tuple(float(value) for value in rest)


def no_input(structure: Structure) -> HeldInput:
    """Return inputs that are zero, of one piece."""
    return together([hold_input(np.zeros(2), 1.0, "foh")] * max(1, len(structure.rig.inputs)))


@dataclass(frozen=True)
class IntegratorEquations:
    """What an integrator evaluates."""

    # Expressions of states, inputs, modes, parameters and `constants`; an output that shows what dry friction
    # holds with reads the friction's sign, or its multiplier while it sticks.
    rates: tuple[sp.Expr, ...]
    switches: tuple[sp.Expr, ...]
    outputs: tuple[sp.Expr, ...]
    constants: dict[sp.Symbol, sp.Expr]  # symbol -> the expression of parameters that it stands for
    # What is computed before the rates, and before the outputs, as `Structure.steps`.
    steps: dict[sp.Symbol, sp.Expr]
    shown_steps: dict[sp.Symbol, sp.Expr]


def equations_of(exported: Exported) -> IntegratorEquations:
    """Return a model's equations with powers and functions of parameters as symbols."""
    # Sums and products of parameters stay: they cost little, and a reader looks for them.
    fixed = set(exported.structure.parameter_symbols)
    found: dict[sp.Expr, sp.Symbol] = {}

    def walk(expression: sp.Expr) -> sp.Expr:
        if not expression.args:
            return expression
        costly = bool(expression.atoms(sp.Function)) or any(
            not power.exp.is_Integer for power in expression.atoms(sp.Pow)
        )
        if expression.free_symbols and expression.free_symbols <= fixed and costly:
            return found.setdefault(expression, sp.Symbol(f"constant {len(found)}", real=True))
        return expression.func(*map(walk, expression.args))

    signs = exported.frozen.friction_signs(exported.structure)
    shown = tuple(output.xreplace(signs) for output in exported.structure.computed_outputs)
    groups = (exported.frozen.rates, exported.frozen.switches, shown)
    rates, switches, outputs = (tuple(map(walk, group)) for group in groups)
    steps = {symbol: walk(step) for symbol, step in exported.frozen.steps.items()}
    shown_steps = {symbol: walk(step.xreplace(signs)) for symbol, step in exported.structure.steps.items()}
    constants = {symbol: expression for expression, symbol in found.items()}
    return IntegratorEquations(rates, switches, outputs, constants, steps, shown_steps)


def fragments_of(exported: Exported) -> dict[str, object]:
    """Return what files with an integrator of fixed steps have in common, by mark."""
    least = MIN_STEPS_PRESCRIBED if exported.follows_motion else MIN_STEPS
    steps_alone = not exported.states or is_linear(exported.frozen, exported.structure)
    return {
        "TITLE": f"Simulation of {exported.title}",
        "HOLD_TEXT": hold_text(exported),
        "MORE_INPUTS": "".join(f", {quantity.name}" for quantity in exported.inputs),
        "STEP": repr(exported.step),
        "MIN_STEPS": 1 if steps_alone else least,
        "N_STATES": len(exported.states),
        "N_MODES": len(exported.frozen.modes),
    }


def constant_names(equations: IntegratorEquations) -> dict[sp.Symbol, str]:
    """Return the names of the constants in code, which in exports differ from all names of rigs and effects."""
    return {symbol: symbol.name.replace(" ", "_") for symbol in equations.constants}


def held_velocity(exported: Exported) -> int | None:
    """Return the index of the state that is the velocity which dry friction can hold; None where it is made of several."""
    return exported.frozen.frictions[0].velocity if exported.frozen.frictions else None


def slope_symbol(index: int) -> sp.Symbol:
    """Return the symbol of the rate of a state, where it is given."""
    return sp.Symbol(f"slope {index}", real=True)


def slip_rate(exported: Exported) -> sp.Expr:
    """Return the time derivative of the velocity that dry friction can hold, by the rates of the states; 0 without friction."""
    if exported.friction is None:
        return sp.S.Zero
    along = {state: slope_symbol(i) for i, state in enumerate(exported.structure.states)}
    along |= {TIME: sp.S.One, **input_rates(len(exported.sources))}
    return rate_along(exported.frozen.switches[exported.friction], along)
