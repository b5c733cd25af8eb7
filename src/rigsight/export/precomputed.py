"""Parts of the equations that depend only on parameters and are too costly to compute at every step."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from rigsight.export.equations import Exported


@dataclass(frozen=True)
class Equations:
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


def equations_of(exported: Exported) -> Equations:
    """Return a model's equations with powers and functions of parameters as symbols.

    Sums and products of parameters stay: they cost little, and a reader looks for them.
    """
    fixed = set(exported.structure.parameter_symbols)
    found: dict[sp.Expr, sp.Symbol] = {}

    def walk(expression: sp.Expr) -> sp.Expr:
        if not expression.args:
            return expression
        if expression.free_symbols and expression.free_symbols <= fixed and _costly(expression):
            return found.setdefault(expression, sp.Symbol(f"constant {len(found)}", real=True))
        return expression.func(*map(walk, expression.args))

    signs = exported.frozen.friction_signs(exported.structure)
    shown = tuple(output.xreplace(signs) for output in exported.structure.computed_outputs)
    groups = (exported.frozen.rates, exported.frozen.switches, shown)
    rates, switches, outputs = (tuple(map(walk, group)) for group in groups)
    steps = {symbol: walk(step) for symbol, step in exported.frozen.steps.items()}
    shown_steps = {symbol: walk(step.xreplace(signs)) for symbol, step in exported.structure.steps.items()}
    constants = {symbol: expression for expression, symbol in found.items()}
    return Equations(rates, switches, outputs, constants, steps, shown_steps)


def constant_names(equations: Equations) -> dict[sp.Symbol, str]:
    """Return the names of the constants in code, which in exports differ from all names of rigs and effects."""
    return {symbol: symbol.name.replace(" ", "_") for symbol in equations.constants}


def _costly(expression: sp.Expr) -> bool:
    powers = (power for power in expression.atoms(sp.Pow) if not power.exp.is_Integer)
    return bool(expression.atoms(sp.Function)) or any(True for _ in powers)
