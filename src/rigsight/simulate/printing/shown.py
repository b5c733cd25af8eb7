"""Which equations are people shown? Those of the tree, in the order of reading; no language yet."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import sympy as sp

from rigsight.simulate.printing.names import (
    ShownName,
    in_words,
    kinematic_states,
    output_symbol,
    rate_symbol,
    shown_names,
)
from rigsight.simulate.structure import Structure


@dataclass(frozen=True)
class ShownEquation:
    """``left = sum of terms``.

    Attributes
    ----------
    owner
        Name of the effect that it belongs to; None for the rig.
    left
        A symbol, or masses times accelerations.
    terms
        What it is, in the order of reading.
    limit
        A state and the half-width of the range that it cannot leave: it rests at the end it is driven against.
    """

    owner: str | None
    left: sp.Expr
    terms: tuple[sp.Expr, ...]
    limit: tuple[sp.Symbol, sp.Expr] | None = None

    @property
    def signed_terms(self) -> tuple[tuple[str, sp.Expr], ...]:
        """The terms, each with what joins it to the one before: ``+``, ``-``, or nothing at the head."""
        if len(self.terms) == 1:
            return (("", self.terms[0]),)
        parts = [part for term in self.terms for part in sp.Add.make_args(term)]
        signed: list[tuple[str, sp.Expr]] = []
        for part in parts:
            negative = part.as_coeff_Mul()[0].is_negative
            plus = "+" if signed else ""
            signed.append(("-", -part) if negative else (plus, part))
        return tuple(signed)


@dataclass(frozen=True)
class ShownEquations:
    """The equations of a structure with the names of their symbols.

    Attributes
    ----------
    names
        Name of each symbol.
    equations
        The equations; those of one owner follow each other, the rig's come first.
    """

    names: Mapping[sp.Symbol, ShownName]
    equations: tuple[ShownEquation, ...]

    @property
    def of_owners(self) -> dict[str | None, tuple[ShownEquation, ...]]:
        """The equations of the rig (None), then those of each effect by its name, in the order of the signal path."""
        owners = dict.fromkeys(equation.owner for equation in self.equations)
        return {owner: tuple(e for e in self.equations if e.owner == owner) for owner in owners}


def shown_equations(structure: Structure, label: Callable[[str], str] = in_words) -> ShownEquations:
    """Return the equations of a structure as people are shown them.

    Parameters
    ----------
    structure
        Rig and effects.
    label
        An effect's name for people.
    """
    tree = structure.tree
    names = shown_names(structure, label)
    effects = [
        ShownEquation(d.owner, d.symbol, (d.expression,)) for d in tree.definitions if d.rate_of is None
    ]
    kinematic = kinematic_states(structure)
    states = [
        ShownEquation(
            state.owner,
            rate_symbol(kinematic.get(state.symbol, state.symbol)),
            state.terms,
            None if state.limit is None else (state.symbol, state.limit),
        )
        for state in tree.states
        if state.symbol not in kinematic
    ]
    every = [*_motion(structure), *effects, *states, *_outputs(structure)]
    owners = dict.fromkeys([None, *(equation.owner for equation in every)])
    return ShownEquations(names, tuple(e for owner in owners for e in every if e.owner == owner))


def _motion(structure: Structure) -> list[ShownEquation]:
    motion = structure.tree.motion
    accelerations = sp.Matrix([rate_symbol(velocity) for velocity in motion.velocities])
    inertial = motion.mass * accelerations if motion.velocities else ()
    return [ShownEquation(None, left, terms) for left, terms in zip(inertial, motion.terms, strict=True)]


def _outputs(structure: Structure) -> list[ShownEquation]:
    # A state that is recorded as it is bears the column's name already.
    states = structure.states
    return [
        ShownEquation(None, output_symbol(output.name), output.terms)
        for output in structure.tree.outputs
        if sp.Add(*output.terms) not in states
    ]
