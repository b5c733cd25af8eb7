"""Evaluation of long expressions part by part, so that common parts are computed once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

_NO_STEPS: Mapping[sp.Symbol, sp.Expr] = {}


@dataclass(frozen=True)
class StraightLine:
    """Expressions in parts."""

    parts: Mapping[sp.Symbol, sp.Expr]  # symbol -> its expression in arguments and earlier symbols
    results: tuple[sp.Expr, ...]  # the expressions in terms of arguments and parts

    def function(self, arguments: Sequence[sp.Symbol], modules: list[Any]) -> Callable[..., Any]:
        """Return a function of numbers or arrays that returns the results as a list."""
        # Valid Python names, because sympy would search all parts to replace each invalid one.
        plain = {s: sp.Symbol(f"v{i}", real=True) for i, s in enumerate((*arguments, *self.parts))}
        parts = [(plain[s], part.xreplace(plain)) for s, part in self.parts.items()]
        results = [result.xreplace(plain) for result in self.results]
        function: Callable[..., Any] = sp.lambdify(
            [plain[s] for s in arguments], results, modules, cse=lambda written: (parts, written)
        )
        return function


def straight_line(
    expressions: Iterable[sp.Expr],
    steps: Mapping[sp.Symbol, sp.Expr] = _NO_STEPS,
    name: str = "shared",
) -> StraightLine:
    """Return expressions in parts."""
    expressions = tuple(map(sp.sympify, expressions))
    steps = needed_steps(expressions, steps)
    names = (sp.Symbol(f"{name} {i}", real=True) for i in range(1_000_000))
    shared, reduced = sp.cse([*steps.values(), *expressions], symbols=names, optimizations=None)
    parts = {**dict(shared), **dict(zip(steps, reduced, strict=False))}
    return of_parts(parts, tuple(reduced[len(steps) :]))


def needed_steps(
    expressions: Iterable[sp.Expr], steps: Mapping[sp.Symbol, sp.Expr]
) -> dict[sp.Symbol, sp.Expr]:
    """Return those of the steps that expressions need."""
    waiting = [s for expression in expressions for s in expression.free_symbols if s in steps]
    found: set[sp.Symbol] = set()
    while waiting:
        symbol = waiting.pop()
        if symbol not in found:
            found.add(symbol)
            waiting += [s for s in steps[symbol].free_symbols if s in steps]
    return {symbol: step for symbol, step in steps.items() if symbol in found}


def of_parts(parts: Mapping[sp.Symbol, sp.Expr], results: tuple[sp.Expr, ...]) -> StraightLine:
    """Return results with the parts that they need, each part after those on which it depends."""
    ordered: dict[sp.Symbol, sp.Expr] = {}
    inner = {s: [i for i in in_order(part.free_symbols) if i in parts] for s, part in parts.items()}
    for result in results:
        waiting = [s for s in reversed(in_order(result.free_symbols)) if s in parts]
        while waiting:
            symbol = waiting[-1]
            missing = [s for s in inner[symbol] if s not in ordered]
            if missing and symbol not in ordered:
                waiting += reversed(missing)
            else:
                ordered.setdefault(waiting.pop(), parts[symbol])
    return StraightLine(ordered, results)


def in_order(symbols: Iterable[sp.Symbol]) -> list[sp.Symbol]:
    """Return symbols in an order that is the same in every run."""
    return sorted(symbols, key=lambda symbol: symbol.name)
