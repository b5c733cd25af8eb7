"""Is there independent evidence for one more effect, or does it only compensate for the inexact form of the previous ones?

No law is exact on a measured rig: friction may change sign smoothly, a spring may be slightly nonlinear. The resulting residual
depends on the same signal as the effect itself, and a second effect may explain it as well as a better form of the first. So the
gain of a pair is compared with the gain of any other law of the same signal at the place of the first effect.

Two effects of the spring, two damping effects, two linear effects between drive and motion act as one law: their sum resembles
many laws outside the catalogue. Of 14 such pairs named on blind rigs, ten imitated a cause outside the catalogue, and two
imitated a single effect whose own fit had stopped too early (seeds 3 to 8, `experiments/blind_standard`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
import sympy as sp

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.noise.evidence import Evidence
from rigsight.diagnose.policy import FAMILIES, SEARCH, VERDICT
from rigsight.diagnose.pushes.alternatives import law_columns
from rigsight.diagnose.pushes.responses import Responses, orthonormal
from rigsight.effects import Effect, Place
from rigsight.effects import symbols as canonical
from rigsight.rigs import Rig


def split_distinguishable(
    pairs: Sequence[FittedModel],
    singles: Sequence[FittedModel],
    allowed: float,
    is_adequate: Callable[[FittedModel], bool],
) -> tuple[list[FittedModel], list[FittedModel]]:
    """Return the pairs that compete, and those that act as one law and are excluded because other laws fit equally well."""
    # Such pairs compete only if no single effect comes near the floor and the best of them reaches it or leaves only noise and
    # disturbance: the residual of an imitation correlates with the motion.
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


class OtherForms:
    """How much of the residual of a model other forms of its effects would explain, computed once for each."""

    # If the noise floor is only a lower bound, no part of a residual can be attributed to noise beforehand.

    def __init__(self, context: FitContext, lower_bound: bool) -> None:
        self._context = context
        self._noise = 0.0 if lower_bound else 1.0
        # A model that is fitted again has the same names, but another residual.
        self._known: dict[tuple[tuple[str, ...], float], float] = {}

    def gain(self, model: FittedModel) -> float:
        """Return the reduction of a model's mean square error, in units of the noise floor, by another form of one effect."""
        key = (model.names, model.fit.cost)
        if key not in self._known:
            responses = Responses(
                self._context, self._context.scoring, model.held_out, model.effects, model.fit.free
            )
            forms = [orthonormal(responses.without_free(law_columns(responses, e))) for e in model.effects]
            gains = [float(np.sum((form.T @ responses.remainder) ** 2)) for form in forms]
            self._known[key] = max(gains) / responses.n_measured
        return self._known[key]

    def with_own_evidence(
        self, singles: Sequence[FittedModel], larger: Sequence[FittedModel]
    ) -> list[FittedModel]:
        """Return the models without pairs whose second effect explains less than another form of the first would."""
        # A pair that leaves only noise stands: nothing is left for another form. A third effect was compared with other forms of
        # the first two before it was tried.
        alone = {
            model.names[0]: model
            for model in singles
            if model.residuals and np.isfinite(model.error_over_noise)
        }

        def stands(model: FittedModel) -> bool:
            single = alone.get(model.names[0])
            # Two effects that act as one law are other forms of each other; they are distinguished by other means.
            if len(model.effects) > 2 or single is None or not model.residuals or is_one_law(model):
                return True
            if self._noise > 0.0 and model.error_over_noise <= VERDICT.exact:
                return True
            return self.gain(single) < VERDICT.larger_part * (
                single.error_over_noise**2 - model.error_over_noise**2
            )

        return [model for model in larger if stands(model)]


def beyond_disturbance(
    evidence: Evidence,
    rivals: Sequence[FittedModel],
    singles: Sequence[FittedModel],
    larger: Sequence[FittedModel],
) -> list[FittedModel]:
    """Return the models that explain more than any rival with a disturbance, and increase no part of the error of their parts."""
    # A disturbance excites the resonances of a rig, and a second effect with its own motion can follow that in each record. If
    # the form of the first is slightly wrong, a second that excites the rig may compensate a slow error but cause a fast one.
    # Rivals are single effects that leave about as little as the best of them.
    if not larger or not rivals:
        return list(larger)
    least = min(evidence.criterion(model) for model in rivals)

    def stands(model: FittedModel) -> bool:
        parts = [
            part for part in (*singles, *larger) if part.residuals and set(part.names) < set(model.names)
        ]
        return evidence.criterion(model) < least and all(evidence.gain(model, part) > 0.0 for part in parts)

    return [model for model in larger if not model.residuals or stands(model)]


def with_parts(chosen: Sequence[FittedModel], larger: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the chosen models and the others of several effects that are parts of them: they tell the share of each effect."""
    names = [set(model.names) for model in chosen]
    return [model for model in larger if any(set(model.names) <= own for own in names)]


def evidence_of_share(explained: float, without: float, per_share: float) -> float:
    """Return the evidence [nats] of a family, from the shares that are explained with it and without it."""
    # What a law errs remains in both.
    of_law = SEARCH.law_error**2
    with_it, without_it = (1.0 - min(max(own, 0.0), 1.0) + of_law for own in (explained, without))
    return per_share * math.log(without_it / with_it)


def chance_of_further_cause(together: float, without: float) -> float:
    """Return how probable a family is as a further cause, from the shares that a model explains with it and without it."""
    weight = math.exp(evidence_of_share(together, without, FAMILIES.per_simulation))
    return weight / ((1.0 + FAMILIES.failing) * weight + FAMILIES.other_causes)
