"""Dry friction in exports with their own integrator: which joint slides, and the rate of change of its velocity."""

from __future__ import annotations

import sympy as sp

from rigsight.effects.symbols import derivative
from rigsight.export.equations import Exported
from rigsight.simulate.equations.structure import TIME, input_symbols


def friction_mode(exported: Exported) -> int | None:
    """Return the index of the mode that is the sign of the velocity which dry friction can hold, or None."""
    return exported.frictions[0] if exported.frictions else None


def friction_sign(exported: Exported) -> sp.Symbol:
    """Return the symbol of this velocity's sign in outputs; while the friction sticks it stands for the share that holds."""
    return exported.frozen.friction_sign(0)


def held_velocity(exported: Exported) -> int | None:
    """Return the index of the state that this velocity is; None where it is made of several."""
    mode = friction_mode(exported)
    states = exported.structure.states
    switch = None if mode is None else exported.frozen.switches[mode]
    return states.index(switch) if switch in states else None


def slope_symbol(index: int) -> sp.Symbol:
    """Return the symbol of the rate of a state, where it is given."""
    return sp.Symbol(f"slope {index}", real=True)


def slip_rate(exported: Exported) -> sp.Expr:
    """Return the time derivative of the velocity that dry friction can hold, by the rates of the states; 0 without friction."""
    mode = friction_mode(exported)
    if mode is None:
        return sp.S.Zero
    along = {state: slope_symbol(i) for i, state in enumerate(exported.structure.states)}
    along[TIME] = sp.S.One
    for index in range(len(exported.sources)):
        value, rate, curvature = input_symbols(index)
        along |= {value: rate, rate: curvature}
    switch = exported.frozen.switches[mode]
    return sp.Add(*(derivative(switch, s) * rate for s, rate in along.items() if s in switch.free_symbols))
