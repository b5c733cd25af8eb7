"""Printing of expressions and statements in programming languages, and of the bodies of C functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import sympy as sp
from sympy.printing.c import C99CodePrinter
from sympy.printing.octave import OctaveCodePrinter
from sympy.printing.pycode import PythonCodePrinter

from rigsight.simulate.equations.straight_line import StraightLine, needed_steps, straight_line
from rigsight.simulators import simulated_slope

_NO_STEPS: Mapping[sp.Symbol, sp.Expr] = {}

_LONGEST_CHAIN = 3
"""Number of terms up to which a sum is added one after the other."""

_LANE_FUNCTIONS = {
    "Abs": "abs", "absolute": "abs", "sign": "sign_of", "positive_part": "positive", "limited": "within"
}  # fmt: skip
"""Functions whose names for vectors differ from those in the equations."""
# Only functions that are called are written: some compilers warn of unused ones.
FUNCTIONS = {
    "sign_of": "static inline double sign_of(double value) { return value > 0.0 ? 1.0 : (value < 0.0 ? -1.0 : 0.0); }",
    "positive": "static inline double positive(double value) { return value > 0.0 ? value : 0.0; }",
    "within": (
        "static inline double within(double value, double limit) "
        "{ return value > limit ? limit : (value < -limit ? -limit : value); }"
    ),
}


class PowersAsProducts:
    """Small powers as products, because `pow` is slow and, in a control loop, has no guaranteed duration."""

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:  # noqa: ARG002, N802
        printer: Any = self
        if expr.exp.is_Integer and 2 <= abs(int(expr.exp)) <= 6:
            product = "*".join([printer.parenthesize(expr.base, 1000)] * abs(int(expr.exp)))
            return f"({product})" if expr.exp > 0 else f"(1.0/({product}))"
        return str(super()._print_Pow(expr))  # type: ignore[misc]


@dataclass(frozen=True)
class Language:
    """Syntax of a language: its printer, and the forms of a declaration and of an assignment."""

    printer: Any
    declared: str
    assigned: str

    def expression(self, expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
        """Return one expression with its symbols renamed."""
        named = {symbol: names[symbol] for symbol in expression.free_symbols if symbol in names}
        return str(self.printer.doprint(_plain(expression.xreplace(_symbols(named)))))

    def statements(
        self,
        targets: Sequence[str],
        expressions: Sequence[sp.Expr],
        names: Mapping[sp.Symbol, str],
        steps: Mapping[sp.Symbol, sp.Expr] = _NO_STEPS,
    ) -> list[str]:
        """Return statements that assign expressions to targets, sharing common parts."""
        if needed_steps(expressions, steps):
            return self.written(targets, straight_line(expressions, steps), names)
        known = _symbols(names)
        renamed = [expression.xreplace(known) for expression in expressions]
        parts = (sp.Symbol(f"part{i}", real=True) for i in range(10_000))
        shared, reduced = sp.cse(renamed, symbols=parts, optimizations=None)
        lines = [self.declared.format(s.name, self.printer.doprint(_plain(e))) for s, e in shared]
        return lines + [
            self.assigned.format(target, self.printer.doprint(_plain(e)))
            for target, e in zip(targets, reduced, strict=True)
        ]

    def written(
        self, targets: Sequence[str], line: StraightLine, names: Mapping[sp.Symbol, str]
    ) -> list[str]:
        """Return statements that assign expressions, whose parts are known, to targets."""
        own = {part: part_name(part) for part in line.parts}
        every = {**names, **own}
        known = _symbols(every)
        printed = [_printed(self.printer, e.xreplace(known)) for e in (*line.parts.values(), *line.results)]
        forms = [(self.declared, name) for name in own.values()]
        forms += [(self.assigned, target) for target in targets]
        return [form.format(target, text) for (form, target), text in zip(forms, printed, strict=True)]


def part_name(part: sp.Symbol) -> str:
    """Return the name in code of a part of an expression; in exports it differs from all names of rigs and effects."""
    return f"part_{part.name.replace(' ', '_')}"


@lru_cache(maxsize=16_384)
def _printed(printer: Any, expression: sp.Expr) -> str:
    """Return a part as code, cached because those of a rig do not depend on its effects."""
    return str(printer.doprint(_plain(expression)))


def _symbols(names: Mapping[sp.Symbol, str]) -> dict[sp.Symbol, sp.Symbol]:
    return {symbol: sp.Symbol(name, real=True) for symbol, name in names.items()}


def _plain(expression: sp.Expr) -> sp.Expr:
    return expression.evalf() if expression.is_number else expression


def _asked(leaf: sp.Function) -> tuple[str, Sequence[sp.Expr]]:
    """Return which value another simulator is asked for, or by which argument its slope, and the arguments."""
    count = 2 if isinstance(leaf, simulated_slope) else 1
    return ", ".join(str(int(number)) for number in leaf.args[1 : 1 + count]), leaf.args[1 + count :]


def _called(function: str, *further: str) -> Callable[[Any, sp.Function], str]:
    """Return the method of a printer that writes a function as a call of another one."""
    return lambda printer, expr: f"{function}({', '.join([*map(printer._print, expr.args), *further])})"


class MatlabPrinter(OctaveCodePrinter):  # type: ignore[misc]
    """MATLAB for scalars, so that operators need no dot."""

    def _print_Mul(self, expr: sp.Mul) -> str:  # noqa: N802
        return str(super()._print_Mul(expr)).replace(".*", "*").replace("./", "/")

    def _print_Pow(self, expr: sp.Pow) -> str:  # noqa: N802
        return str(super()._print_Pow(expr)).replace(".^", "^").replace("./", "/")

    _print_absolute, _print_positive_part = _called("abs"), _called("max", "0")


MATLAB = Language(MatlabPrinter(), "{} = {};", "{} = {};")


class ModelicaPrinter(C99CodePrinter):  # type: ignore[misc]
    """Modelica: ``^`` for powers; ``abs``, ``sign`` and ``max`` are built in and generate their own events."""

    def _print_Pow(self, expr: sp.Pow) -> str:  # noqa: N802
        if expr.exp == -1:
            return f"1.0/{self.parenthesize(expr.base, 1000)}"
        if expr.exp == sp.Rational(1, 2):
            return f"sqrt({self._print(expr.base)})"
        return f"{self.parenthesize(expr.base, 1000)}^{self.parenthesize(expr.exp, 1000)}"

    _print_Abs, _print_sign = _called("abs"), _called("sign")  # noqa: N815
    _print_positive_part = _called("max", "0.0")


MODELICA = Language(ModelicaPrinter(), "{} = {};", "{} = {};")


class PythonPrinter(PowersAsProducts, PythonCodePrinter):  # type: ignore[misc]
    """Python; ``sign_of`` is a function in the generated file."""

    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": True, "strict": False})

    _print_Abs = _print_absolute = _called("abs")  # noqa: N815
    _print_positive_part, _print_sign = _called("max", "0.0"), _called("sign_of")

    def _print_Rational(self, expr: sp.Rational) -> str:  # noqa: N802
        return repr(float(expr))

    _print_Half = _print_Rational  # noqa: N815


PYTHON = Language(PythonPrinter(), "{} = {}", "{} = {}")


class limited(sp.Function):  # type: ignore[misc]  # noqa: N801
    """First argument, limited to plus and minus the second: two instructions, where `clamp` would need six."""

    is_real = True


class CPrinter(PowersAsProducts, C99CodePrinter):  # type: ignore[misc]
    """C99 with products for small powers; ``sign_of``, ``positive`` and ``within`` are functions in the generated file."""

    def _print_Rational(self, expr: sp.Expr) -> str:  # noqa: N802
        return repr(float(expr))

    _print_NumberSymbol = _print_Pi = _print_Exp1 = _print_Rational  # noqa: N815

    def _print_Integer(self, expr: sp.Integer) -> str:  # noqa: N802
        # Integers beyond the range of C would overflow; a double can represent them.
        return f"{int(expr)}.0" if abs(int(expr)) < 10**15 else repr(float(expr))

    def _print_Add(self, expr: sp.Add, order: str | None = None) -> str:  # noqa: N802
        # A compiler may not reorder a sum, so each term of a long one would wait for all earlier ones.
        terms = self._as_ordered_terms(expr, order)
        if len(terms) <= _LONGEST_CHAIN:
            return str(super()._print_Add(expr, order))
        half = len(terms) // 2
        parts = [sp.Add(*part, evaluate=False) for part in (terms[:half], terms[half:])]
        return " + ".join(f"({self._print_Add(part, order)})" for part in parts)

    _print_sign, _print_absolute = _called("sign_of"), _called("fabs")
    _print_positive_part, _print_limited = _called("positive"), _called("within")

    def _print_simulated(self, expr: sp.Function) -> str:
        numbers, arguments = _asked(expr)
        listed = ", ".join(map(self._print, arguments))
        return f"{type(expr).__name__}(0, {numbers}, (const double[]){{{listed}}})"

    def _print_simulated_slope(self, expr: sp.Function) -> str:
        return self._print_simulated(expr)


class LanePrinter(CPrinter):
    """The same for vectors: every function has a prefix ``v_`` and takes only vectors."""

    def doprint(self, expr: sp.Expr, assign_to: str | None = None) -> str:
        """Return an expression as a vector."""
        text = str(super().doprint(expr, assign_to))
        return f"v_all({text})" if expr.is_number else text

    def _vector(self, expr: sp.Expr) -> str:
        text = str(self._print(expr))
        return f"v_all({text})" if expr.is_number else text

    def _call(self, name: str, *arguments: sp.Expr) -> str:
        return f"v_{name}({', '.join(map(self._vector, arguments))})"

    def _print_Function(self, expr: sp.Function) -> str:  # noqa: N802
        return self._call(_LANE_FUNCTIONS.get(type(expr).__name__, type(expr).__name__), *expr.args)

    def _print_Add(self, expr: sp.Add, order: str | None = None) -> str:  # noqa: N802
        # The vectors of many sets hide this latency.
        return str(C99CodePrinter._print_Add(self, expr, order))

    # sympy's C printer has methods for these, which would print the scalar function.
    _print_sin = _print_cos = _print_tan = _print_asin = _print_acos = _print_atan = _print_atan2 = (
        _print_Function
    )
    _print_sinh = _print_cosh = _print_tanh = _print_asinh = _print_exp = _print_log = _print_Function
    _print_Abs = _print_absolute = _print_sign = _print_positive_part = _print_limited = (  # noqa: N815
        _print_Function
    )

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:  # noqa: N802
        if expr.exp == -1:
            return f"1.0/{self.parenthesize(expr.base, 1000)}"
        if expr.exp == sp.Rational(1, 2):
            return self._call("sqrt", expr.base)
        if expr.exp.is_Integer and 2 <= abs(int(expr.exp)) <= 6:
            return super()._print_Pow(expr, rational)
        return self._call("pow", expr.base, expr.exp)

    def _print_simulated(self, expr: sp.Function) -> str:
        numbers, arguments = _asked(expr)
        listed = ", ".join(map(self._vector, arguments))
        return f"v_{type(expr).__name__}({numbers}, {len(arguments)}, (const lanes[]){{{listed}}})"


C = Language(CPrinter(), "const double {} = {};", "{} = {};")

C_LANES = Language(LanePrinter(), "const lanes {} = {};", "{} = {};")


def real(name: str) -> sp.Symbol:
    """Return a symbol whose name is C code already."""
    return sp.Symbol(name, real=True)


def symbols(array: str, count: int) -> list[sp.Symbol]:
    """Return the elements of a C array as symbols."""
    return [real(element) for element in elements(array, count)]


def elements(array: str, count: int) -> list[str]:
    """Return the elements of a C array as text."""
    return [f"{array}[{i}]" for i in range(count)]


def function_body(
    arguments: Sequence[str],
    targets: Sequence[str],
    expressions: Sequence[sp.Expr],
    names: Mapping[sp.Symbol, str],
    *,
    lanes: bool = False,
    steps: Mapping[sp.Symbol, sp.Expr] = _NO_STEPS,
) -> str:
    """Return the body of a function; arguments that its equations do not use are marked as unused for the compiler."""
    needed = needed_steps(expressions, steps)
    read = set().union(*(e.free_symbols for e in (*expressions, *needed.values())))
    for symbol in sorted(read - set(needed) - set(names), key=str):
        raise KeyError(
            f"The symbol {symbol} has no number: names of rigs and effects must not appear in C code."
        )
    lines = (C_LANES if lanes else C).statements(targets, expressions, names, needed) if targets else []
    return _marked(arguments, lines)


def lane_body(targets: Sequence[str], line: StraightLine, names: Mapping[sp.Symbol, str]) -> str:
    """Return the body of a function of vector lanes that computes expressions in parts."""
    return _marked((), C_LANES.written(targets, line, names))


def _marked(arguments: Sequence[str], lines: Sequence[str]) -> str:
    text = "\n".join(lines)
    unread = [a for a in arguments if f"{a}[" not in text and f"{a}->" not in text]
    marks = [" ".join(f"(void){argument};" for argument in unread)] if unread else []
    return "\n".join(f"    {line}" for line in [*marks, *lines])
