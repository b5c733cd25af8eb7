"""Torques of displacement and velocity for discovered equations that no effect of the catalogue describes.

The products ``x^i x'^j`` up to the third degree, each declared as an effect so that the engine simulates a discovered model like
any other. They only describe a force and name no cause, so a diagnosis does not use them.
"""

from __future__ import annotations

import sympy as sp

from rigsight.effects import CATALOGUE, Effect
from rigsight.effects.effect import Energy, GainTrend, Place, Signature
from rigsight.effects.symbols import v, x
from rigsight.parameters import Parameter

DEGREE = 3
_PREFIX = "monomial"


def _monomial(i: int, j: int) -> Effect:
    name = f"c_{i}{j}"
    dimension = " ".join(
        factor for factor in ("force", f"x^{-(i + j)}" if i + j else "", f"time^{j}" if j else "") if factor
    )
    # Odd in the velocity and even in the displacement: it dissipates energy (or, with a negative coefficient, supplies it).
    damps = j % 2 == 1 and i % 2 == 0
    return Effect(
        name=f"{_PREFIX}_x{i}_v{j}",
        place=Place.DYNAMICS,
        summary=_summary(i, j),
        parameters=(
            Parameter(
                name, "coefficient of the monomial", dimension, lower=-1e30, upper=1e30, null=0.0, starts=(0.1, -0.1),
                search=(-1e3, 1e3),
            ),
        ),
        energy=Energy.DISSIPATIVE if damps else Energy.ACTIVE,
        signature=Signature(gain_trend=GainTrend.STEADY, even_harmonics=(i + j) % 2 == 0),
        torque=sp.Symbol(name, real=True) * x**i * v**j,
    )  # fmt: skip


def _summary(i: int, j: int) -> str:
    if i == j == 0:
        return "A constant resisting torque."
    return f"A resisting torque proportional to {_power('x', i)}{' ' if i and j else ''}{_power(chr(120) + chr(39), j)}."


def _power(symbol: str, exponent: int) -> str:
    if exponent == 0:
        return ""
    return symbol if exponent == 1 else f"{symbol}^{exponent}"


def _powers() -> list[tuple[int, int]]:
    known = [
        sp.Poly(effect.torque, x, v).monoms()[0]
        for effect in CATALOGUE
        if effect.torque is not None and effect.torque.is_polynomial(x, v)
    ]
    all_powers = [(degree - j, j) for degree in range(2, DEGREE + 1) for j in range(degree + 1)]
    return [powers for powers in all_powers if powers not in known]


MONOMIALS: tuple[Effect, ...] = tuple(_monomial(i, j) for i, j in _powers())
"""Monomials of degree 2 and 3, without those that an effect of the catalogue already describes."""


LINEAR: tuple[Effect, ...] = tuple(_monomial(i, j) for i, j in ((0, 0), (1, 0), (0, 1)))
"""A constant force, a spring and a damper: terms for a joint for which the rig declares none."""


def known_terms() -> dict[str, Effect]:
    """Return every effect that a model may contain, by name: those of the catalogue and the monomials."""
    return {effect.name: effect for effect in (*CATALOGUE, *MONOMIALS, *LINEAR)}
