"""Candidates: every effect at every place of the rig to which it applies."""

from __future__ import annotations

from collections.abc import Iterable

from rigsight.effects import Effect, Place, placed
from rigsight.rigs import Rig


def candidates_on(rig: Rig, effects: Iterable[Effect], modelled: Iterable[Effect] = ()) -> list[Effect]:
    """Return effects at the places of a rig, in the order of the effects.

    On one mass or one element each effect has only one place, so its name needs no place.

    Parameters
    ----------
    rig
        The rig.
    effects
        Without a place; those that have one keep it.
    modelled
        Effects that the simulation has already.
    """
    there = {effect.name for effect in modelled}
    found = []
    for effect in effects:
        if rig.has_one_motion or effect.at is not None:
            found.append(effect)
        else:
            found += [placed(effect, place) for place in _places(rig, effect)]
    return [effect for effect in found if rig.offers(effect) and effect.name not in there]


def _places(rig: Rig, effect: Effect) -> tuple[str, ...]:
    places = rig.places(effect.place)
    # What comes from outside and not from a motion is the same force at each joint of one coordinate: the first stands for them.
    if effect.place is not Place.DISTURBANCE:
        return places
    motions = {joint.name: joint.motion for joint in rig.mechanism.joints}
    return tuple({motions[place]: place for place in reversed(places)}.values())[::-1]
