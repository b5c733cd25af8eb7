"""Meaning of the names in the declarations of a rig and its effects in the equations of one structure."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.rigs import Rig, acceleration
from rigsight.simulate.equations.structure import TIME, input_symbols


class Binder:
    """Replaces the symbols of rig and effect declarations by those of one structure.

    Parameters
    ----------
    rig
        The rig.
    symbols
        Symbol of each parameter of the structure, by its name in the structure.
    unique
        Name of each effect's parameter in the structure, by (effect, own name).
    fixed
        Values of parameters that appear in the equations as numbers.
    """

    def __init__(
        self,
        rig: Rig,
        symbols: Mapping[str, sp.Symbol],
        unique: Mapping[tuple[str, str], str],
        fixed: Mapping[str, float],
    ) -> None:
        self._symbols = symbols
        self._unique = unique
        self._fixed = {name: sp.nsimplify(value) for name, value in fixed.items()}
        mechanism = rig.mechanism
        own: dict[sp.Symbol, sp.Expr] = {
            sp.Symbol(p.name, real=True): symbols[p.name] for p in (*rig.constants, *rig.parameters)
        }
        inputs = {name: input_symbols(index) for index, name in enumerate(mechanism.inputs)}
        own |= {sp.Symbol(name, real=True): value for name, (value, _, _) in inputs.items()}
        for coordinate in mechanism.prescribed:
            moved = (coordinate.symbol, coordinate.rate, acceleration(coordinate))
            own |= dict(zip(moved, inputs[str(coordinate.prescribed_by)], strict=True))
        self._own = own

    def rig(self, expression: sp.Expr) -> sp.Expr:
        """Bind an expression of the rig's declaration."""
        return expression.xreplace({s: self._own[s] for s in expression.free_symbols if s in self._own})

    def effect(self, effect: Effect, expression: sp.Expr, signals: Mapping[str, sp.Expr]) -> sp.Expr:
        """Bind an expression of an effect; `signals` are the expressions of the canonical symbols, by name."""
        states = {state.symbol for state in effect.states}
        replacement: dict[sp.Symbol, sp.Expr] = {canonical.t: TIME}
        for symbol in expression.free_symbols:
            name = self._unique.get((effect.name, symbol.name))
            if symbol in states:
                replacement[symbol] = state_symbol(effect, symbol)
            elif symbol.name in signals:
                replacement[symbol] = signals[symbol.name]
            elif name is not None:
                replacement[symbol] = self._fixed[name] if name in self._fixed else self._symbols[name]
        return expression.xreplace(replacement)


def state_symbol(effect: Effect, symbol: sp.Symbol) -> sp.Symbol:
    """Return the symbol of an effect's state within a structure; two effects may use the same own name, such as z."""
    return sp.Symbol(f"{effect.name}.{symbol.name}", real=True)
