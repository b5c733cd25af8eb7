"""Named expressions along the signal path, and what stands for the rig's own signals once effects have changed them."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from rigsight.effects import Effect, placed_dimension
from rigsight.rigs import Rig
from rigsight.simulate.equations.binder import Binder, state_symbol
from rigsight.simulate.equations.tree import (
    Definition,
    EquationsOfMotion,
    EquationTree,
    FirstOrderState,
    Kind,
)


class DefinedSignals:
    """Definitions in the order in which they were made.

    Parameters
    ----------
    binder
        Binds expressions of the rig and of effects.
    rig
        The rig.
    """

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
        for symbol, signal in self._signals.items():
            if symbol in expression.free_symbols and symbol not in self._values:
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
        self, kind: Kind, effect: Effect, expression: sp.Expr, rate_of: sp.Symbol | None = None
    ) -> sp.Symbol:
        """Return a symbol for an expression that an effect changes."""
        # Names of effects and parameters contain no colon, so there is no conflict.
        symbol = sp.Symbol(f"{effect.name}:{kind.value}", real=True)
        self.definitions.append(Definition(symbol, expression, kind, effect.name, rate_of))
        return symbol

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
