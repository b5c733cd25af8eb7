"""Where does a rig of several motions rest? The equations that an export solves for it, as the engine does."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from rigsight.simulate.linear_forms import slope
from rigsight.simulate.structure import TIME, Structure, input_symbols


@dataclass(frozen=True)
class Balance:
    """What is zero at the static equilibrium, of unknown states, inputs and parameters.

    Attributes
    ----------
    unknown
        Indices of the states that are sought: all but the velocities.
    residuals
        Rates of all states but the coordinates, at rest.
    slopes
        Their derivatives by the unknown states, row by row.
    start
        Expression of parameters at which the search starts, or that a velocity has, by index of the state; 0 where none is given.
    """

    unknown: tuple[int, ...]
    residuals: tuple[sp.Expr, ...]
    slopes: tuple[tuple[sp.Expr, ...], ...]
    start: dict[int, sp.Expr]


def balance(structure: Structure) -> Balance | None:
    """Return what is zero at the equilibrium of a rig; None where it has no state.

    Parameters
    ----------
    structure
        Rig and effects.
    """
    motion, states = structure.tree.motion, structure.states
    unknown = tuple(i for i, symbol in enumerate(states) if symbol not in motion.velocities)
    if not unknown:
        return None
    still = dict.fromkeys((*motion.velocities, TIME), sp.Integer(0))
    for index in range(len(structure.rig.inputs)):
        still |= dict.fromkeys(input_symbols(index)[1:], sp.Integer(0))
    residuals = tuple(
        equation.rate.xreplace(still)
        for equation in structure.equations
        if equation.symbol not in motion.coordinates
    )
    own = dict(zip(structure.names, structure.parameter_symbols, strict=True))
    initial = structure.rig.mechanism.initial
    return Balance(
        unknown,
        residuals,
        tuple(tuple(slope(residual, states[i]) for i in unknown) for residual in residuals),
        {
            states.index(symbol): value.xreplace({s: own[s.name] for s in value.free_symbols})
            for symbol, value in initial.items()
            if symbol in states
        },
    )
