"""Forms of long expressions with the fewest operations: common parts, and parts of parameters alone, are computed once."""

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
        # sympy looks for functions that are given as such, of other programs, in the results alone.
        called = {f for _, part in parts for f in part.atoms(sp.Function) if hasattr(f, "_imp_")}
        given = {type(f).__name__: f._imp_ for f in called}
        function: Callable[..., Any] = sp.lambdify(
            [plain[s] for s in arguments], results, [given, *modules], cse=lambda written: (parts, written)
        )
        return function


def straight_line(
    expressions: Iterable[sp.Expr], steps: Mapping[sp.Symbol, sp.Expr] = _NO_STEPS, name: str = "shared"
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
    found: set[sp.Symbol] = set()
    while more := {s for expression in expressions for s in expression.free_symbols if s in steps} - found:
        found |= more
        expressions = [steps[symbol] for symbol in more]
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


def hoist_constants(
    expressions: Sequence[sp.Expr], constants: set[sp.Symbol]
) -> tuple[list[sp.Expr], dict[sp.Symbol, sp.Expr]]:
    """Replace every largest subexpression that contains only constants by a symbol."""
    hoisted: dict[sp.Expr, sp.Symbol] = {}
    walked: dict[sp.Expr, sp.Expr] = {}

    def symbol_for(expression: sp.Expr) -> sp.Symbol:
        return hoisted.setdefault(expression, sp.Symbol(f"constant {len(hoisted)}", real=True))

    def walk(expression: sp.Expr) -> sp.Expr:
        if expression not in walked:
            walked[expression] = rewritten(expression)
        return walked[expression]

    def rewritten(expression: sp.Expr) -> sp.Expr:
        if expression.is_number:
            return expression
        if expression.free_symbols <= constants:
            return symbol_for(expression)
        if not expression.args:
            return expression
        if expression.is_Add or expression.is_Mul:
            fixed = [a for a in expression.args if a.free_symbols and a.free_symbols <= constants]
            numbers = [a for a in expression.args if a.is_number]
            if fixed and (len(fixed) > 1 or numbers):
                rest = [a for a in expression.args if a not in fixed and a not in numbers]
                combined = expression.func(*fixed, *numbers)
                return expression.func(symbol_for(combined), *[walk(a) for a in rest])
        return expression.func(*[walk(argument) for argument in expression.args])

    replaced = [walk(expression) for expression in expressions]
    return replaced, {symbol: expression for expression, symbol in hoisted.items()}


def gathered(expression: sp.Expr, constants: set[sp.Symbol], modes: set[sp.Symbol] | None = None) -> sp.Expr:
    """Return an expression as a sum of products with one constant coefficient each, if that takes fewer operations."""
    # Arguments of functions are not changed.
    inner = {
        atom: sp.Dummy(f"inner{i}", real=True)
        for i, atom in enumerate(_whole(expression, modes or set()))
        if atom.free_symbols - constants
    }
    outer = sp.expand_mul(expression.xreplace(inner), deep=True)
    coefficients: dict[sp.Expr, list[sp.Expr]] = {}
    for term in sp.Add.make_args(outer):
        fixed, varying = term.as_independent(*(term.free_symbols - constants), as_Add=False)
        coefficients.setdefault(varying, []).append(fixed)
    back = {dummy: atom for atom, dummy in inner.items()}
    products = [sp.Mul(sp.Add(*fixed), varying) for varying, fixed in coefficients.items()]
    candidate = sp.Add(*products).xreplace(back)
    return candidate if _operations(candidate, constants) < _operations(expression, constants) else expression


def _whole(expression: sp.Expr, modes: set[sp.Symbol]) -> list[sp.Expr]:
    """Return the outermost functions, powers and sums of modes in an expression, in a fixed order."""
    if isinstance(expression, sp.Function) or (expression.is_Pow and not expression.exp.is_Integer):
        return [expression]
    if expression.is_Add and expression.free_symbols and expression.free_symbols <= modes:
        return [expression]
    found = [atom for argument in expression.args for atom in _whole(argument, modes)]
    return list(dict.fromkeys(found))


def _operations(expression: sp.Expr, constants: set[sp.Symbol]) -> int:
    """Count the operations after functions of constants are computed; multiplying and adding a product costs one."""
    if not expression.free_symbols - constants:
        return 0
    varying = [a for a in expression.args if a.free_symbols - constants]
    own = len(varying) - 1 + (len(varying) < len(expression.args))
    inside: int = sum(_operations(argument, constants) for argument in varying)
    if expression.is_Add:
        return own + inside - sum(bool(argument.is_Mul) for argument in varying)
    if expression.is_Pow and expression.exp.is_Integer:
        return abs(int(expression.exp)) - 1 + inside
    return inside + (own if expression.is_Mul else min(1, len(expression.args)))
