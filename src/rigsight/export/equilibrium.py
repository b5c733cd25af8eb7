"""Equilibrium of a rig with several motions: the equations that an export solves for it, like the engine."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from rigsight.effects.symbols import clamp
from rigsight.simulate.equations.derivatives import slope
from rigsight.simulate.equations.kinks import freeze, is_zero
from rigsight.simulate.equations.structure import TIME, Structure, input_symbols

NO_START = "with friction or hysteresis the equilibrium is known only for zero inputs: begin with these, or give initial_state"
"""Message of a file if another equilibrium is requested."""


@dataclass(frozen=True)
class Balance:
    """What is zero at the static equilibrium, of unknown states, inputs and parameters."""

    # Indices of the states that are sought: all but the velocities and those that the rig's file gives.
    unknown: tuple[int, ...]
    residuals: tuple[sp.Expr, ...]  # for each of them what has to vanish at rest
    slopes: tuple[tuple[sp.Expr, ...], ...]  # derivatives of the residuals by the unknown states, row by row
    # Expression of parameters of each state that is given, by its index; the others start at 0.
    start: dict[int, sp.Expr]
    # True where friction or hysteresis holds what the way of the inputs left: then only that without input is
    # known.
    remembers: bool

    @property
    def expressions(self) -> list[sp.Expr]:
        """The residuals, then their derivatives row by row."""
        return [*self.residuals, *(slope for row in self.slopes for slope in row)]


def balance(structure: Structure) -> Balance | None:
    """Return what is zero at the equilibrium of a rig, as `rigsight.simulate.equilibrium` has it; None without a state."""
    motion, states = structure.tree.motion, structure.states
    if not states:
        return None
    own = dict(zip(structure.names, structure.parameter_symbols, strict=True))
    start = {
        states.index(symbol): value.xreplace({s: own[s.name] for s in value.free_symbols})
        for symbol, value in structure.rig.mechanism.initial.items()
        if symbol in states
    }
    n = len(motion.coordinates)
    unknown = tuple(i for i in (*range(n), *range(2 * n, len(states))) if i not in start)
    residuals = {i: _residual(structure, i, start) for i in unknown}
    memories = [i for i in unknown if i >= n and _is_memory(structure, i)]
    return Balance(
        unknown,
        tuple(residuals.values()),
        tuple(tuple(slope(residual, states[i]) for i in unknown) for residual in residuals.values()),
        start,
        bool(memories or freeze(structure).frictions),
    )


def _at_rest(structure: Structure) -> dict[sp.Symbol, sp.Expr]:
    rising = [symbol for i in range(len(structure.rig.inputs)) for symbol in input_symbols(i)[1:]]
    return dict.fromkeys((*rising, TIME), sp.S.Zero)


def _still(structure: Structure) -> dict[sp.Symbol, sp.Expr]:
    return {**_at_rest(structure), **dict.fromkeys(structure.tree.motion.velocities, sp.S.Zero)}


def _is_memory(structure: Structure, index: int) -> bool:
    """Return True for a state that nothing moves at rest: it holds what the way to rest left."""
    return is_zero(structure.equations[index].rate.xreplace(_still(structure)))


def _residual(structure: Structure, index: int, start: dict[int, sp.Expr]) -> sp.Expr:
    """Return what vanishes at rest: what a coordinate lacks of balance, the rate of a state, or what a memory has of the way."""
    motion = structure.tree.motion
    n = len(motion.coordinates)
    if index < n:
        return structure.out_of_balance[index].xreplace(_still(structure))
    equation = structure.equations[index]
    if not _is_memory(structure, index):
        return equation.rate.xreplace(_still(structure))
    gone = {
        velocity: coordinate - start.get(i, sp.S.Zero)
        for i, (coordinate, velocity) in enumerate(zip(motion.coordinates, motion.velocities, strict=True))
    }
    reached = start.get(index, sp.S.Zero) + equation.rate.xreplace({**_at_rest(structure), **gone})
    return equation.symbol - (reached if equation.limit is None else clamp(reached, equation.limit))
