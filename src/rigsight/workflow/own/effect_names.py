"""Find the effect and the place that a name means: ``coulomb_friction@load_bearing``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from rigsight.campaign import Campaign
from rigsight.diagnose import candidates_on
from rigsight.effects import AT, CATALOGUE, Effect, kind_of, placed
from rigsight.errors import InputError, nearest
from rigsight.rigs import Rig


def effects_on(rig: Rig, effects: Iterable[Effect], where: str) -> tuple[Effect, ...]:
    """Return declared effects as they act on a rig."""
    catalogue = {effect.name: effect for effect in CATALOGUE}
    found = []
    for effect in effects:
        kind = kind_of(effect.name)
        if effect.at is not None and kind not in catalogue:
            _check_place(rig, effect, effect.at, where)
            found.append(effect)
        else:
            known = {kind: effect} if effect.at is None else catalogue
            found.append(effect_on(rig, effect.name, known, where))
    return tuple(found)


def effect_on(rig: Rig, name: str, known: Mapping[str, Effect], where: str) -> Effect:
    """Return the effect that a name means on a rig."""
    kind, place = kind_of(name), name.partition(AT)[2]
    if kind not in known:
        raise InputError(f"{where}: '{kind}' is unknown.{nearest(kind, known)} Known: {', '.join(known)}.")
    effect = known[kind]
    if AT in name:
        _check_place(rig, effect, place, where)
        # On a rig of one motion, results name an effect without its place.
        is_usual = rig.has_one_motion and place == rig.acts_at(effect)
        return effect if is_usual else placed(effect, place)
    if rig.has_one_motion:
        return effect
    at_places = [placed(effect, one) for one in rig.places(effect.place)]
    offered = [one for one in at_places if rig.offers(one)]
    if len(offered) > 1:
        listed = ", ".join(one.name for one in offered)
        raise InputError(f"{where}: '{kind}' can act at several places of {rig.name}; name one: {listed}.")
    # If it applies nowhere, the composition raises the error.
    return offered[0] if offered else effect


def _check_place(rig: Rig, effect: Effect, place: str, where: str) -> None:
    places = rig.places(effect.place)
    if place not in places:
        listed = ", ".join(places) or "none"
        raise InputError(
            f"{where}: '{kind_of(effect.name)}{AT}{place}': {rig.name} has no such place for it.{nearest(place, places)} "
            f"Its places: {listed}."
        )


def candidates_of(campaign: Campaign, effects: Sequence[Effect]) -> list[Effect]:
    """Return the candidates at every place of a campaign's rig."""
    # An effect without a place is skipped if it does not apply; a place that was named must exist.
    named = [effect for effect in effects if effect.at is None] + [
        *effects_on(campaign.rig, [effect for effect in effects if effect.at is not None], "The candidates")
    ]
    found = candidates_on(campaign.rig, named, campaign.modelled)
    modelled = {kind_of(effect.name) for effect in campaign.modelled}
    if named and not found and not any(kind_of(effect.name) in modelled for effect in named):
        listed = ", ".join(f"'{effect.name}'" for effect in named)
        raise InputError(
            f"The candidates: {listed} cannot act on {campaign.rig.name}. "
            "'rigsight effects' lists all with their kind of place."
        )
    return found
