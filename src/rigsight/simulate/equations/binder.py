"""What names in the declarations of a rig and its effects mean in the equations of one structure, and its named values."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from rigsight.effects import Effect, placed_dimension
from rigsight.effects import symbols as canonical
from rigsight.rigs import Rig, acceleration
from rigsight.simulate.equations.structure import TIME, input_symbols
from rigsight.simulate.equations.tree import (
    Definition,
    EquationsOfMotion,
    EquationTree,
    FirstOrderState,
    Kind,
)


class Binder:
    """Replaces the symbols of rig and effect declarations by those of one structure.

    `unique` has the name of each effect's parameter in the structure, by (effect, own name); those in `fixed` become numbers.
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
        return expression.xreplace(self._own)

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


class DefinedSignals:
    """Definitions in the order in which they were made."""

    def __init__(self, binder: Binder, rig: Rig) -> None:
        self.binder = binder
        self.definitions: list[Definition] = []
        self._signals = rig.mechanism.signals
        self._values: dict[sp.Symbol, sp.Expr] = {}
        """Expressions of signals, drives and sensors, by the symbols that denote them in the rig."""

    def stands_for(self, symbol: sp.Symbol, expression: sp.Expr) -> None:
        """From here on an expression stands for a drive or a sensor."""
        self._values[symbol] = expression

    def bound(self, expression: sp.Expr) -> sp.Expr:
        """Bind an expression of the rig, with drives and sensors after their effects."""
        # Asked once: sympy walks through the whole expression, which is long on an arm of six joints.
        read = expression.free_symbols
        for symbol, signal in self._signals.items():
            if symbol in read and symbol not in self._values:
                self._values[symbol] = self.name(Kind.SIGNAL, symbol.name, self.bound(signal))
        return self.binder.rig(expression).xreplace(self._values)

    def flattened(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression without symbols of definitions."""
        return EquationTree((), tuple(self.definitions), EquationsOfMotion(), (), ()).flattened(expression)

    def name(self, kind: Kind, name: str, expression: sp.Expr) -> sp.Expr:
        """Return a symbol for a named expression of the rig; an expression that is a symbol already keeps it."""
        if expression.is_Symbol:
            return expression
        symbol = sp.Symbol(f"{name}:{kind.value}", real=True)
        self.definitions.append(Definition(symbol, expression, kind, None, name=name))
        return symbol

    def define(
        self, kind: Kind, effect: Effect, expression: sp.Expr, rate_of: sp.Symbol | None = None, of: str = ""
    ) -> sp.Symbol:
        """Return a symbol for an expression that an effect changes; ``of`` tells several of one kind apart."""
        # Names of effects and parameters contain no colon, so there is no conflict.
        symbol = sp.Symbol(f"{effect.name}{of}:{kind.value}", real=True)
        self.definitions.append(Definition(symbol, expression, kind, effect.name, rate_of))
        return symbol

    def changed(
        self,
        kind: Kind,
        effect: Effect,
        expression: sp.Expr,
        signals: Mapping[str, sp.Expr],
        states: list[FirstOrderState],
    ) -> sp.Symbol:
        """Return a symbol for an expression in an effect's own symbols, see `Binder.effect`; its states are appended."""
        states += self.states(effect, signals)
        return self.define(kind, effect, self.binder.effect(effect, expression, signals))

    def states(self, effect: Effect, signals: Mapping[str, sp.Expr]) -> list[FirstOrderState]:
        """Return the states of an effect; `signals` are the expressions of canonical symbols, by name."""
        return [
            FirstOrderState(
                symbol=state_symbol(effect, s.symbol),
                terms=(self.binder.effect(effect, s.rate, signals),),
                dimension=placed_dimension(effect, s.dimension),
                limit=None if s.limit is None else self.binder.effect(effect, s.limit, signals),
                owner=effect.name,
            )
            for s in effect.states
        ]
