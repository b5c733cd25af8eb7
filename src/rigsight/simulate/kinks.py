"""Where a structure's equations are not smooth: every Abs, sign and positive part, as a mode frozen between events."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from rigsight.effects.symbols import positive_part
from rigsight.simulate.structure import Structure

_KINKS = (sp.Abs, sp.sign, positive_part)


class absolute(sp.Function):  # type: ignore[misc]  # noqa: N801
    """Absolute value that stays one: the base of a power with a real exponent, smooth enough not to be an event."""

    is_real = True
    is_nonnegative = True

    def fdiff(self, argindex: int = 1) -> sp.Expr:  # noqa: ARG002
        """Return the slope."""
        return sp.sign(self.args[0])


@dataclass(frozen=True)
class FrozenStructure:
    """A structure with each kink's sign as a symbol.

    Attributes
    ----------
    rates, outputs
        Expressions in states, parameters and `modes`; smooth between events.
    modes
        Symbols that take the values -1 and +1.
    switches
        Expression whose sign each mode is; it may hold modes of earlier switches.
    friction_mode
        Index of the mode whose flip makes the acceleration jump (dry friction: the velocity can stay at zero), or None.
    """

    rates: tuple[sp.Expr, ...]
    outputs: tuple[sp.Expr, ...]
    modes: tuple[sp.Symbol, ...]
    switches: tuple[sp.Expr, ...]
    friction_mode: int | None

    @property
    def dependent_modes(self) -> tuple[int, ...]:
        """Indices of the modes whose switch holds another mode: when that one flips, they are to be read anew."""
        return tuple(i for i, switch in enumerate(self.switches) if switch.free_symbols & set(self.modes))


def freeze(structure: Structure) -> FrozenStructure:
    """Replace every Abs, sign and positive part in a structure's equations by a mode symbol."""
    constant = set(structure.parameter_symbols)
    expressions = [*(state.limited_rate for state in structure.equations), *structure.computed_outputs]
    modes: dict[sp.Expr, sp.Symbol] = {}
    while True:
        kink = _innermost_kink(expressions, constant)
        if kink is None:
            break
        argument = kink.args[0]
        flipped = argument.could_extract_minus_sign()
        switch = -argument if flipped else argument
        mode = modes.setdefault(switch, sp.Symbol(f"mode_{len(modes)}", real=True))
        powers = {
            power: absolute(switch) ** power.exp
            for expression in expressions
            for power in expression.atoms(sp.Pow)
            if power.base == sp.Abs(argument) and not power.exp.is_Integer
        }
        signed = -mode if flipped else mode
        replacement = {
            **powers,
            sp.Abs(argument): mode * switch,
            sp.sign(argument): signed,
            positive_part(argument): sp.Mul(argument, 1 + signed, sp.Rational(1, 2)),
        }
        expressions = [expression.xreplace(replacement) for expression in expressions]
    n_states = len(structure.states)
    return FrozenStructure(
        rates=tuple(expressions[:n_states]),
        outputs=tuple(expressions[n_states:]),
        modes=tuple(modes.values()),
        switches=tuple(modes),
        friction_mode=_friction_mode(structure, modes, expressions),
    )


def _innermost_kink(expressions: list[sp.Expr], constant: set[sp.Symbol]) -> sp.Expr | None:
    candidates = {
        atom
        for expression in expressions
        for atom in expression.atoms(*_KINKS)
        if not atom.args[0].atoms(*_KINKS) and not atom.free_symbols <= constant
    }
    return min(candidates, key=sp.default_sort_key) if candidates else None


def _friction_mode(
    structure: Structure, modes: dict[sp.Expr, sp.Symbol], expressions: list[sp.Expr]
) -> int | None:
    if structure.velocity_index is None:
        return None
    velocity = structure.states[structure.velocity_index]
    for index, (switch, mode) in enumerate(modes.items()):
        if switch == velocity:
            at_rest = expressions[structure.velocity_index].subs(velocity, 0)
            if sp.simplify(sp.diff(at_rest, mode)) != 0:
                return index
    return None
