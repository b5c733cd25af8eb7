"""Products of unknown parameters, told apart without multiplying out what is known."""

from __future__ import annotations

import pytest
import sympy as sp

from rigsight.identify.start.weak_equations import MixedError, parameter_products

M, C, L, Q, W = sp.symbols("m c l q w", real=True)
UNKNOWN, SIGNALS = frozenset({M, C}), frozenset({Q, W})


def test_products_and_what_multiplies_them_make_the_whole() -> None:
    speed = L * sp.cos(Q) * W + C * sp.cos(2 * Q) * W
    whole = M * (speed**2 + sp.sin(Q) ** 2) / 2 + 3 * C * W + L * Q
    found = parameter_products(whole, UNKNOWN, SIGNALS)
    assert set(found) == {M, M * C, M * C**2, C, sp.S.One}
    assert not any(factor.free_symbols & UNKNOWN for factor in found.values())
    assert sp.expand(sp.Add(*(product * factor for product, factor in found.items())) - whole) == 0


def test_a_function_of_parameters_alone_is_a_factor() -> None:
    found = parameter_products(W * sp.sqrt(M) / (M + C), UNKNOWN, SIGNALS)
    assert sp.simplify(sp.Add(*(p * f for p, f in found.items())) - W * sp.sqrt(M) / (M + C)) == 0
    assert all(factor == W for factor in found.values())


@pytest.mark.parametrize("mixed", [sp.sin(M * Q), (M + Q) ** -1, sp.Abs(C + W)])
def test_what_cannot_be_told_apart_is_told(mixed: sp.Expr) -> None:
    with pytest.raises(MixedError):
        parameter_products(W * mixed, UNKNOWN, SIGNALS)
