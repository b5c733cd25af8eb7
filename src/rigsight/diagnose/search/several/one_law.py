"""Do two effects act together as a single law, which other laws would fit equally well?

Two effects of the spring, two damping effects, two linear effects between drive and motion: their sum resembles many laws outside
the catalogue. Of 14 such pairs named on blind rigs, ten imitated a cause outside the catalogue, and two imitated a single effect
whose own fit had stopped too early (seeds 3 to 8, `experiments/blind_standard`).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import sympy as sp

from rigsight.diagnose.fitting.fit_context import FittedModel
from rigsight.diagnose.policy import VERDICT
from rigsight.effects import Effect, Place
from rigsight.effects import symbols as canonical
from rigsight.rigs import Rig


def split_distinguishable(
    pairs: Sequence[FittedModel],
    singles: Sequence[FittedModel],
    allowed: float,
    is_adequate: Callable[[FittedModel], bool],
) -> tuple[list[FittedModel], list[FittedModel]]:
    """Return the pairs that compete, and those that act as one law and are excluded because other laws fit equally well.

    Such pairs compete only if no single effect comes near the floor and the best of them reaches it or leaves only noise and
    disturbance: the residual of an imitation correlates with the motion.
    """
    best = min((model.error_over_noise for model in singles), default=float("inf"))
    of_one_law = [pair for pair in pairs if _has_one_law(pair)]
    if not of_one_law:
        return list(pairs), []
    nearest = min(of_one_law, key=lambda pair: pair.error_over_noise)
    if best > allowed and (nearest.error_over_noise <= VERDICT.exact or is_adequate(nearest)):
        return list(pairs), []
    return [pair for pair in pairs if pair not in of_one_law], of_one_law


def _has_one_law(model: FittedModel) -> bool:
    """Return True if two of the effects act as one law."""
    rig = model.fit.structure.rig
    return any(are_one_law(two, rig) for two in itertools.combinations(model.effects, 2))


def is_one_law(model: FittedModel) -> bool:
    """Return True for a pair of effects that act as one law."""
    return are_one_law(model.effects, model.fit.structure.rig)


def are_one_law(effects: Sequence[Effect], rig: Rig) -> bool:
    """Return True for effects that act as one law on a rig."""
    at_one_place = len({effect.at for effect in effects}) == 1
    return len(effects) > 1 and ((at_one_place and _one_force(effects)) or _one_linear_system(effects, rig))


def _one_force(effects: Sequence[Effect]) -> bool:
    """Return True for effects of the spring, or forces without memory of the same signals: their sum is one more such."""
    if all(_is_of_the_spring(effect) for effect in effects):
        return True
    return all(effect.torque is not None and not effect.states for effect in effects) and all(
        _read(effect) == _read(effects[0]) for effect in effects
    )


def _one_linear_system(effects: Sequence[Effect], rig: Rig) -> bool:
    """Return True for linear effects between the same signals: many other linear systems have the same frequency response."""
    one_output = len(rig.outputs) == 1
    return all(
        is_linear(effect) and effect.lateral is None and (one_output or effect.place is not Place.SENSOR)
        for effect in effects
    )


def is_linear(effect: Effect) -> bool:
    """Return True if an effect leaves a linear rig linear."""
    signals = [canonical.x, canonical.v, canonical.u, canonical.reading, canonical.spring_torque]
    signals += [canonical.position, canonical.load, canonical.driven, canonical.acceleration]
    signals += [
        canonical.creepage,
        canonical.lateral_displacement,
        canonical.deflection,
        canonical.deflection_rate,
    ]
    signals += [canonical.output, canonical.error, canonical.command]
    signals += [state.symbol for state in effect.states]
    laws = [
        effect.torque,
        effect.spring,
        effect.deflection,
        effect.drive,
        effect.lateral,
        effect.measured,
        effect.control,
        effect.command,
    ]
    laws += [state.rate for state in effect.states]
    return all(_is_linear_in(law, signals) for law in laws if law is not None) and all(
        state.limit is None for state in effect.states
    )


def _is_linear_in(law: sp.Expr, signals: Sequence[sp.Symbol]) -> bool:
    own = [symbol for symbol in (*signals, canonical.t) if symbol in law.free_symbols]
    return not own or (bool(law.is_polynomial(*own)) and sp.total_degree(law, *own) <= 1)


def _is_of_the_spring(effect: Effect) -> bool:
    is_without_memory = effect.torque is not None and not effect.states
    of_displacement = is_without_memory and effect.reads(canonical.x) and _read(effect) == {canonical.x.name}
    return effect.spring is not None or effect.deflection is not None or of_displacement


def _read(effect: Effect) -> set[str]:
    """Return the names of the signals that a force depends on; a position is a displacement from another rest."""
    assert effect.torque is not None
    read = {symbol.name for symbol in effect.torque.free_symbols} - {p.name for p in effect.parameters}
    return {canonical.x.name if name == canonical.position.name else name for name in read}
