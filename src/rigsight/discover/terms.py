"""Terms that an equation may contain: effects of the catalogue, powers of the motion, drives that change with the motion.

Powers are the products ``x^i x'^j`` up to the third degree, and the force of the drives times a power of the displacement or the
velocity: a motor constant that depends on the position. Each is declared as an effect, so that the engine simulates a discovered
model like any other. They only describe a force and name no cause, so a diagnosis does not use them.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from rigsight.effects import CATALOGUE, Effect, Place, kind_of, placed
from rigsight.effects.effect import Energy, GainTrend, Signature
from rigsight.effects.symbols import driven, v, x
from rigsight.parameters import Parameter
from rigsight.rigs import Joint, Rig

DEGREE = 3
_PREFIX = "monomial"


def _monomial(i: int, j: int) -> Effect:
    name = f"c_{i}{j}"
    # Odd in the velocity and even in the displacement: it dissipates energy (or, with a negative coefficient, supplies it).
    damps = j % 2 == 1 and i % 2 == 0
    return Effect(
        name=f"{_PREFIX}_x{i}_v{j}",
        place=Place.DYNAMICS,
        summary="A constant resisting torque."
        if i == j == 0
        else f"A resisting torque proportional to {_power(i, j)}.",
        parameters=(_coefficient(name, _dimension("force", i, j)),),
        energy=Energy.DISSIPATIVE if damps else Energy.ACTIVE,
        signature=Signature(gain_trend=GainTrend.STEADY, even_harmonics=(i + j) % 2 == 0),
        torque=sp.Symbol(name, real=True) * x**i * v**j,
    )


def _drive_power(i: int, j: int) -> Effect:
    name = f"b_{i}{j}"
    return Effect(
        name=f"drive_x{i}_v{j}",
        place=Place.DYNAMICS,
        summary=f"The force of the drives changes in proportion to {_power(i, j)}.",
        parameters=(_coefficient(name, _dimension("", i, j)),),
        energy=Energy.ACTIVE,
        signature=Signature(gain_trend=GainTrend.STEADY, even_harmonics=(i + j) % 2 == 1),
        torque=-sp.Symbol(name, real=True) * x**i * v**j * driven,
    )


def _coefficient(name: str, dimension: str) -> Parameter:
    return Parameter(
        name, "coefficient of the power", dimension, lower=-1e30, upper=1e30, null=0.0, starts=(0.1, -0.1),
        search=(-1e3, 1e3),
    )  # fmt: skip


def _dimension(of: str, i: int, j: int) -> str:
    return " ".join(part for part in (of, f"x^{-(i + j)}" if i + j else "", f"time^{j}" if j else "") if part)


def _power(i: int, j: int) -> str:
    factors = [(name, exponent) for name, exponent in (("x", i), ("x'", j)) if exponent]
    return " ".join(name if exponent == 1 else f"{name}^{exponent}" for name, exponent in factors)


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

DRIVE_POWERS: tuple[Effect, ...] = tuple(_drive_power(i, j) for i, j in ((1, 0), (2, 0), (0, 1)))
"""Forces of the drives that change with displacement or velocity."""


POWERS = frozenset(effect.name for effect in (*MONOMIALS, *LINEAR, *DRIVE_POWERS))
"""Names of the terms that describe a force and name no cause."""


def known_terms() -> dict[str, Effect]:
    """Return every effect that a model may contain, by name: those of the catalogue and the powers."""
    return {effect.name: effect for effect in (*CATALOGUE, *MONOMIALS, *LINEAR, *DRIVE_POWERS)}


def offered_terms(rig: Rig, own: Sequence[Effect] = ()) -> list[Effect]:
    """Return the effects, of the catalogue or the user, that can be terms in the equations of a rig, at its places."""
    found = []
    for effect in (*CATALOGUE, *own, *MONOMIALS, *LINEAR, *DRIVE_POWERS):
        if effect.place not in (Place.DYNAMICS, Place.ACTUATOR):
            continue
        for place in (None,) if rig.has_one_motion else rig.places(effect.place):
            here = effect if place is None or effect.at is not None else placed(effect, place)
            if rig.offers(here) and not _is_declared(rig, here):
                found.append(here)
    return list({effect.name: effect for effect in found}.values())


def _is_declared(rig: Rig, effect: Effect) -> bool:
    """Return whether a constant force, a spring or a damper is a term of the rig already."""
    if kind_of(effect.name) not in {linear.name for linear in LINEAR}:
        return False
    joints = [joint for joint in rig.mechanism.joints if effect.at in (None, joint.name)]
    return any(effect.torque is not None and _has(joint, effect.torque) for joint in joints)


def _has(joint: Joint, torque: sp.Expr) -> bool:
    if torque.has(x):
        return bool(joint.stiffness != 0)
    return bool(joint.damping != 0) if torque.has(v) else bool(joint.force != 0 or joint.rest != 0)
