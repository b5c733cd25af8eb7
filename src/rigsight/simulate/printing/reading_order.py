"""Order of a displayed sum: positive terms first, then negative ones: ``a - b``, never ``-b + a``."""

from __future__ import annotations

from typing import Any

import sympy as sp


class ReadingOrder:
    """A sympy printer whose sums begin with the positive terms."""

    def _as_ordered_terms(self, expr: sp.Expr, order: str | None = None) -> list[sp.Expr]:
        printer: Any = super()
        terms: list[sp.Expr] = printer._as_ordered_terms(expr, order=order)
        return sorted(terms, key=lambda term: bool(term.could_extract_minus_sign()))
