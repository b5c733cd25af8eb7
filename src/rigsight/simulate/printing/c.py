"""Printing of symbolic expressions in C: for one parameter set, and for several side by side."""

from __future__ import annotations

import sympy as sp
from sympy.printing.c import C99CodePrinter

from rigsight.simulate.printing.language import Language, PowersAsProducts

_LONGEST_CHAIN = 3
"""Number of terms up to which a sum is added one after the other."""


class limited(sp.Function):  # type: ignore[misc]  # noqa: N801
    """First argument, limited to plus and minus the second: two instructions, where `clamp` would need six."""

    is_real = True


class CPrinter(PowersAsProducts, C99CodePrinter):  # type: ignore[misc]
    """C99 with products for small powers; ``sign_of``, ``positive`` and ``within`` are functions in the generated file."""

    def _print_Rational(self, expr: sp.Rational) -> str:  # noqa: N802
        return repr(float(expr))

    def _print_Integer(self, expr: sp.Integer) -> str:  # noqa: N802
        # Integers beyond the range of C would overflow; a double can represent them.
        return f"{int(expr)}.0" if abs(int(expr)) < 10**15 else repr(float(expr))

    def _print_NumberSymbol(self, expr: sp.Expr) -> str:  # noqa: N802
        return repr(float(expr))

    _print_Pi = _print_Exp1 = _print_NumberSymbol  # noqa: N815

    def _print_Add(self, expr: sp.Add, order: str | None = None) -> str:  # noqa: N802
        # A compiler may not reorder a sum, so each term of a long one would wait for all earlier ones.
        terms = self._as_ordered_terms(expr, order)
        if len(terms) <= _LONGEST_CHAIN:
            return str(super()._print_Add(expr, order))
        half = len(terms) // 2
        parts = [sp.Add(*part, evaluate=False) for part in (terms[:half], terms[half:])]
        return " + ".join(f"({self._print_Add(part, order)})" for part in parts)

    def _print_sign(self, expr: sp.sign) -> str:
        return f"sign_of({self._print(expr.args[0])})"

    def _print_absolute(self, expr: sp.Function) -> str:
        return f"fabs({self._print(expr.args[0])})"

    def _print_positive_part(self, expr: sp.Function) -> str:
        return f"positive({self._print(expr.args[0])})"

    def _print_limited(self, expr: sp.Function) -> str:
        return f"within({', '.join(map(self._print, expr.args))})"

    def _print_simulated(self, expr: sp.Function) -> str:
        _, index, *arguments = expr.args
        return f"simulated(0, {int(index)}, (const double[]){{{', '.join(map(self._print, arguments))}}})"

    def _print_simulated_slope(self, expr: sp.Function) -> str:
        _, index, by, *arguments = expr.args
        listed = ", ".join(map(self._print, arguments))
        return f"simulated_slope(0, {int(index)}, {int(by)}, (const double[]){{{listed}}})"


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
        return self._call(type(expr).__name__, *expr.args)

    def _print_Add(self, expr: sp.Add, order: str | None = None) -> str:  # noqa: N802
        # The vectors of many sets hide this latency.
        return str(C99CodePrinter._print_Add(self, expr, order))

    # sympy's C printer has methods for these, which would print the scalar function.
    _print_sin = _print_cos = _print_tan = _print_asin = _print_acos = _print_atan = _print_atan2 = (
        _print_Function
    )
    _print_sinh = _print_cosh = _print_tanh = _print_asinh = _print_exp = _print_log = _print_Function

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:  # noqa: N802
        if expr.exp == -1:
            return f"1.0/{self.parenthesize(expr.base, 1000)}"
        if expr.exp == sp.Rational(1, 2):
            return self._call("sqrt", expr.base)
        if expr.exp.is_Integer and 2 <= abs(int(expr.exp)) <= 6:
            return super()._print_Pow(expr, rational)
        return self._call("pow", expr.base, expr.exp)

    def _print_Abs(self, expr: sp.Abs) -> str:  # noqa: N802
        return self._call("abs", *expr.args)

    def _print_absolute(self, expr: sp.Function) -> str:
        return self._call("abs", *expr.args)

    def _print_sign(self, expr: sp.sign) -> str:
        return self._call("sign_of", *expr.args)

    def _print_positive_part(self, expr: sp.Function) -> str:
        return self._call("positive", *expr.args)

    def _print_limited(self, expr: sp.Function) -> str:
        return self._call("within", *expr.args)

    def _print_simulated(self, expr: sp.Function) -> str:
        _, index, *arguments = expr.args
        listed = ", ".join(map(self._vector, arguments))
        return f"v_simulated({int(index)}, {len(arguments)}, (const lanes[]){{{listed}}})"

    def _print_simulated_slope(self, expr: sp.Function) -> str:
        _, index, by, *arguments = expr.args
        listed = ", ".join(map(self._vector, arguments))
        return f"v_simulated_slope({int(index)}, {int(by)}, {len(arguments)}, (const lanes[]){{{listed}}})"


C = Language(CPrinter(), "const double {} = {};", "{} = {};")
C_LANES = Language(LanePrinter(), "const lanes {} = {};", "{} = {};")
