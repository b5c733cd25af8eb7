"""The causes as families at places: how probable each is, which share of the gap it explains, and its forms.

Records of a measured rig often show that friction is missing at a joint and leave open which of five laws of friction it is. So
the family at its place is stated first, and each form with its probability within the family.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from rigsight.diagnose.fit_context import FittedModel
from rigsight.diagnose.noise.block_means import squared_errors
from rigsight.diagnose.policy import FAMILIES
from rigsight.diagnose.search.evidence_for_more import chance_of_further_cause, evidence_of_share
from rigsight.effects import Effect, Family, placed_dimension
from rigsight.inverse import Proposal
from rigsight.records.record import Floats
from rigsight.rigs import Rig
from rigsight.units import characteristic_value

Key = tuple[Family, str]
"""A family and the place at which it acts."""


@dataclass(frozen=True)
class Form:
    """One form of a family, or several of its effects together."""

    effects: tuple[str, ...]  # names without places
    probability: float  # within the family


@dataclass(frozen=True)
class FamilyAtPlace:
    """A family at a place as a cause of the gap."""

    family: Family
    where: str
    probability: float  # that it is a true cause of the gap
    # Of the squared gap that re-identification leaves, in the diagnosed model; 0 for a family that is not
    # in it.
    share: float
    # 95 % limits over the stretches of the scored records; for a family that is not in the diagnosed model
    # the upper one is what it would explain in its place.
    interval: tuple[float, float]
    forms: tuple[Form, ...]  # the most probable first
    # Of the squared force that the equations leave along the measured motion, by this family alone; None
    # where the sensors do not show the motion, or the family is no term of the equations.
    along_motion: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``families`` in ``diagnosis.json``."""
        return {
            "family": str(self.family),
            "where": self.where,
            "probability": self.probability,
            "share": {"value": self.share, "interval": list(self.interval)},
            "along_motion": self.along_motion,
            "forms": [{"effects": list(f.effects), "probability": f.probability} for f in self.forms],
        }


@dataclass(frozen=True)
class Shares:
    """How the squared gap that re-identification leaves divides into families, remainder and noise; the sum is one."""

    families: float
    remainder: float
    noise: float
    of: Literal["simulation", "motion"] = (
        "simulation"  # of which gap: of the sensors, or of the force along the motion
    )


def families_at_places(
    rig: Rig,
    reidentified: FittedModel,
    diagnosed: FittedModel,
    candidates: Sequence[tuple[FittedModel, float, float]],
    outside: float,
    noise: Floats,
    rng: np.random.Generator,
    proposal: Proposal | None = None,
    by_motion: bool = False,
    impossible: frozenset[tuple[str, ...]] = frozenset(),
) -> tuple[FamilyAtPlace, ...]:
    """Return the families of the diagnosed model and of its probable rivals, the largest share first."""
    # Candidates are all scored models, each with its probability and its share of the ranking. A cause that has none of the forms
    # tried (its probability is `outside`) belongs to a family by what this explains of the gap: a real law is no exact form, and
    # what it leaves does not refute it. If the motion named the diagnosed model, shares are those of the force along it.
    usable = [
        own
        for own in candidates
        if own[0].effects and own[0].residuals and math.isfinite(own[0].error_over_noise)
    ]
    if not usable:
        return ()
    models = [model for model, _, _ in usable]
    squares = squared_errors([reidentified.residuals, *(m.residuals for m in models)], noise)
    drawn = squares.resampled(squares.draws(rng))
    explained = 1.0 - squares.mean[1:] / squares.mean[0]
    explained_drawn = 1.0 - drawn[:, 1:] / drawn[:, :1]
    keys = [frozenset(keys_of(rig, model.effects)) for model in models]
    own_keys = keys_of(rig, diagnosed.effects)
    of_sets = {key_set: [i for i, own in enumerate(keys) if own == key_set] for key_set in set(keys)}
    causes = {} if proposal is None else {(c.family, c.where): c for c in proposal.alone}
    of_rank = [own[2] for own in usable]
    main = _weighed(rig, models, of_rank, explained, proposal, impossible)
    found = []
    for key in dict.fromkeys(itertools.chain(own_keys, *keys)):
        members = [i for i, own in enumerate(keys) if key in own]
        listed = math.fsum(usable[i][1] for i in members)
        beyond = main.get(key, 0.0)
        if key in own_keys and len(own_keys) > 1:
            without = _best(frozenset(own_keys) - {key}, explained, of_sets)
            beyond = max(
                beyond, chance_of_further_cause(_explained_by(diagnosed, models, explained), without)
            )
        # Where the motion decides, no law is exact: that one of the forms tried is the true one explains nothing.
        probability = beyond if by_motion else min(1.0, listed + outside * beyond)
        if key in own_keys and by_motion and key in causes:
            share, (low, high) = causes[key].share, causes[key].interval
        elif key in own_keys:
            share = _share(key, own_keys, explained, of_sets)
            ends = [_share(key, own_keys, row, of_sets) for row in explained_drawn]
            low, high = (float(end) for end in np.quantile(ends, FAMILIES.limits))
        elif probability < FAMILIES.listed:
            continue
        else:
            alone = [i for i in members if len(keys[i]) == 1] or members
            best = max(alone, key=lambda i: explained[i])
            share, low = 0.0, 0.0
            high = float(np.clip(np.quantile(explained_drawn[:, best], FAMILIES.limits[1]), 0.0, 1.0))
        along = max(0.0, causes[key].share) if key in causes else None
        forms = _forms(rig, key, [usable[i] for i in members])
        found.append(FamilyAtPlace(*key, probability, share, (low, high), forms, along))
    return tuple(sorted(found, key=lambda own: (-own.share, -own.probability)))


def with_shown_families(model: FittedModel, scales: Mapping[str, float]) -> FittedModel:
    """Return a model in which a hysteresis that yields at once counts as dry friction, whose limiting case it is."""

    def shown(effect: Effect) -> Effect:
        part = yielding_part(model, effect, scales)
        at_once = part is not None and part < FAMILIES.yields_at_once
        return replace(effect, family=Family.DRY_FRICTION) if at_once else effect

    return replace(model, effects=tuple(map(shown, model.effects)))


def yielding_part(model: FittedModel, effect: Effect, scales: Mapping[str, float]) -> float | None:
    """Return the deflection over which a hysteresis yields as a share of the motion; None if it does not yield."""
    if effect.yields_over is None:
        return None
    structure, values = model.fit.structure, model.fit.all_values
    own = {
        symbol: values[structure.parameter_name(effect, symbol.name)]
        for symbol in effect.yields_over.free_symbols
    }
    over = effect.yields_over.subs(own)
    return (
        float(over) / characteristic_value(placed_dimension(effect, "x"), scales)
        if over.is_positive
        else None
    )


def shares_of_force(found: Sequence[FamilyAtPlace], proposal: Proposal) -> Shares:
    """Return how the squared force divides that the equations leave along the motion."""
    families = min(1.0, math.fsum(own.share for own in found))
    noise = min(proposal.noise or 0.0, 1.0 - families)
    return Shares(families, 1.0 - families - noise, noise, "motion")


def shares_of_gap(
    found: Sequence[FamilyAtPlace], reidentified: FittedModel, diagnosed: FittedModel, is_adequate: bool
) -> Shares:
    """Return how the squared gap divides; what an adequate model leaves counts as noise and disturbance."""
    families = math.fsum(own.share for own in found)
    gap, error = reidentified.error_over_noise, diagnosed.error_over_noise
    above = 0.0 if is_adequate or not gap > 0.0 else max(error**2 - 1.0, 0.0) / max(gap**2, 1.0)
    remainder = min(above, max(0.0, 1.0 - families))
    return Shares(families, remainder, 1.0 - families - remainder)


def main_causes(
    rig: Rig,
    reidentified: FittedModel,
    candidates: Sequence[tuple[FittedModel, float]],
    noise: Floats,
    proposal: Proposal | None,
    impossible: frozenset[tuple[str, ...]] = frozenset(),
) -> dict[Key, float]:
    """Return how probable each family is as the main cause where no law is exact, from models and their shares of the ranking."""
    usable = [
        own
        for own in candidates
        if own[0].effects and own[0].residuals and math.isfinite(own[0].error_over_noise)
    ]
    if not usable:
        return {}
    squares = squared_errors([reidentified.residuals, *(model.residuals for model, _ in usable)], noise)
    explained = np.asarray(1.0 - squares.mean[1:] / squares.mean[0])
    models, shares = [model for model, _ in usable], [share for _, share in usable]
    return _weighed(rig, models, shares, explained, proposal, impossible)


def probable_part(
    rig: Rig, reidentified: FittedModel, model: FittedModel, others: Sequence[FittedModel]
) -> FittedModel:
    """Return a model without the families that are less probable than not beside its other ones."""
    gap = reidentified.error_over_noise**2
    usable = [(frozenset(keys_of(rig, own.effects)), own) for own in others if own.residuals]
    while len(keys := frozenset(keys_of(rig, model.effects))) > 1:
        chances = []
        for key in sorted(keys):
            parts = [own for its_keys, own in usable if its_keys and its_keys <= keys - {key}]
            if parts:
                part = min(parts, key=lambda own: own.error_over_noise)
                without = 1.0 - part.error_over_noise**2 / gap
                chances.append(
                    (chance_of_further_cause(1.0 - model.error_over_noise**2 / gap, without), part)
                )
        least, smaller = min(chances, key=lambda own: own[0], default=(1.0, model))
        if least >= FAMILIES.probable:
            break
        model = smaller
    return model


def _weighed(
    rig: Rig,
    models: Sequence[FittedModel],
    of_rank: Sequence[float],
    explained: Floats,
    proposal: Proposal | None,
    impossible: frozenset[tuple[str, ...]],
) -> dict[Key, float]:
    """Return how probable each family is as the main cause where no law is exact."""
    # A family that leaves the share r of a squared error is 1/r^n times as probable as one that explains nothing: n is half the
    # number of independent pieces of evidence that law errors leave in records. Simulation and motion are asked, and the share of
    # the ranking, which also knows which parameters are plausible; it counts as far as the best simulation explains the gap. What
    # cannot be the cause explains nothing, and the motion says nothing of a family none of whose fits can be, unless simulations
    # do not see its force.
    counts = float(np.clip(np.max(explained, initial=0.0), 0.0, 1.0))
    keys = [frozenset(keys_of(rig, model.effects)) for model in models]
    counting = [own for model, own in zip(models, keys, strict=True) if model.names not in impossible]
    of_motion: dict[Key, float] = {}
    if proposal is not None:
        per_share = FAMILIES.per_motion * (1.0 - proposal.by_chance)
        alone = [own for own in proposal.alone if any((own.family, own.where) in key for key in counting)]
        of_motion = {(own.family, own.where): evidence_of_share(own.share, 0.0, per_share) for own in alone}
        # What nothing tells from a larger gain is as probable by the motion as the best family: simulations decide.
        open_to_motion = {
            key
            for model, own in zip(models, keys, strict=True)
            for key in own
            if proposal.undecided & set(model.names) and model.names not in impossible
        }
        of_motion |= dict.fromkeys(open_to_motion, max(of_motion.values(), default=0.0))
    weights = {}
    for key in dict.fromkeys(itertools.chain(*map(sorted, keys))):
        share = math.fsum(own for own, having in zip(of_rank, keys, strict=True) if key in having)
        simulated = max(
            (
                float(e)
                for model, e, having in zip(models, explained, keys, strict=True)
                if having == {key} and model.names not in impossible
            ),
            default=0.0,
        )
        weights[key] = max(share, FAMILIES.least_rank) ** counts * math.exp(
            evidence_of_share(simulated, 0.0, FAMILIES.per_simulation) + of_motion.get(key, 0.0)
        )
    whole = (1.0 + FAMILIES.failing) * math.fsum(weights.values()) + FAMILIES.other_causes
    return {key: weight / whole for key, weight in weights.items()}


def _explained_by(model: FittedModel, models: Sequence[FittedModel], explained: Floats) -> float:
    return max((float(explained[i]) for i, own in enumerate(models) if own is model), default=0.0)


def keys_of(rig: Rig, effects: Sequence[Effect]) -> tuple[Key, ...]:
    """Return the families of effects at their places, each once."""
    return tuple(dict.fromkeys((effect.family, rig.where(effect)) for effect in effects))


def _share(
    key: Key,
    of_model: Sequence[Key],
    explained: Floats,
    of_sets: Mapping[frozenset[Key], Sequence[int]],
) -> float:
    """Return what a family adds to what the others explain, averaged over the orders of adding them: Shapley's value."""
    steps = []
    for order in itertools.permutations(of_model):
        earlier = frozenset(order[: order.index(key)])
        steps.append(_best(earlier | {key}, explained, of_sets) - _best(earlier, explained, of_sets))
    return float(np.mean(steps))


def _best(keys: frozenset[Key], explained: Floats, of_sets: Mapping[frozenset[Key], Sequence[int]]) -> float:
    """Return what a set of families explains: at least what the best part of it does that was fitted."""
    found = (float(explained[i]) for own, at in of_sets.items() if own <= keys for i in at)
    return max(0.0, max(found, default=0.0))


def _forms(rig: Rig, key: Key, members: Sequence[tuple[FittedModel, float, float]]) -> tuple[Form, ...]:
    weights: dict[tuple[str, ...], float] = {}
    # Where no form is probable, because none is exact, the ranking alone tells them apart.
    by_probability = math.fsum(probability for _, probability, _ in members) > 0.0
    for model, probability, rank_share in members:
        own = tuple(
            effect.name.partition("@")[0]
            for effect in model.effects
            if (effect.family, rig.where(effect)) == key
        )
        weights[own] = weights.get(own, 0.0) + (probability if by_probability else rank_share)
    whole = math.fsum(weights.values())
    forms = [Form(own, weight / whole if whole > 0.0 else 0.0) for own, weight in weights.items()]
    return tuple(sorted((f for f in forms if f.probability > 0.0), key=lambda f: -f.probability))
