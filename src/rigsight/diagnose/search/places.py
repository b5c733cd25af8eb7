"""Which places of a rig and which effects are fitted? Those that explain nearly as much in the screening as the best one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.search.screening import Shortlist, Suspect
from rigsight.effects import Effect, Family


@dataclass(frozen=True)
class SuspectedPlace:
    """A joint, drive or sensor, and the share of the squared residual that the best push there explains."""

    name: str
    share: float
    examined: bool


@dataclass(frozen=True)
class Search:
    """Where to look, and for which effects."""

    # All of them, the most suspected first; empty on a rig with one motion, where each kind of effect has one
    # place.
    places: tuple[SuspectedPlace, ...]
    effects: tuple[Effect, ...]  # candidates that are looked at
    # Share of the squared residual that the best push of an effect explains, by its name.
    shares: Mapping[str, float]
    # Own values of an effect with which its push explains most, by its name.
    starts: Mapping[str, Mapping[str, float]]
    others: tuple[Effect, ...] = ()  # the rest, for a gap that none of these explains

    @property
    def most(self) -> float:
        """Largest share of the squared residual that a push explains."""
        return max(self.shares.values(), default=0.0)


def search_places(context: FitContext, model: FittedModel, effects: Sequence[Effect]) -> Search:
    """Return the places at which the residual of a model may arise, on a rig with one motion the effects that may cause it."""
    # A periodic disturbance is independent of the motion, so that no push represents it; a position-periodic effect has another
    # form at every wave number.
    pushing = [effect for effect in effects if not _stands_for_itself(effect)]
    # For one mass a few seconds of motion are sufficient; for several joints, the evidence may be in only one of the records.
    suspects = Shortlist(context, model, liveliest=context.rig.has_one_motion).suspects(pushing)
    own_shares = {suspect.effect.name: suspect.share for suspect in suspects}
    most = max(own_shares.values(), default=0.0)
    starts = {suspect.effect.name: suspect.values for suspect in suspects if suspect.values}
    if context.rig.has_one_motion:
        promising = _promising(effects, own_shares)
        return Search(
            (), promising, own_shares, starts, tuple(effect for effect in effects if effect not in promising)
        )
    shares = _by_place(context, suspects)
    places = sorted(
        (SuspectedPlace(name, share, share >= VERDICT.larger_part * most) for name, share in shares.items()),
        key=lambda place: -place.share,
    )
    examined = {place.name for place in places if place.examined}
    at_places = [effect for effect in effects if context.rig.acts_at(effect) in examined]
    # What is late in one place makes all readings behind it late: fits tell the places apart, if the records do.
    suspected = max(own_shares, key=own_shares.__getitem__, default="")
    is_late = any(_is_late(effect) for effect in effects if effect.name == suspected)
    everywhere = [effect for effect in effects if is_late and _is_late(effect)]
    first = [e for e in effects if _stands_for_itself(e) or e in at_places or e in everywhere]
    return Search(
        tuple(places),
        tuple(first),
        own_shares,
        starts,
        tuple(effect for effect in effects if effect not in first),
    )


def _promising(effects: Sequence[Effect], shares: Mapping[str, float]) -> tuple[Effect, ...]:
    """Return the effects whose push explains enough or that no push represents, and the simpler ones from which they start."""
    enough = VERDICT.larger_part * max(shares.values(), default=0.0)
    found = [effect for effect in effects if shares.get(effect.name, enough) >= enough]
    parents = {name for effect in found for name in effect.parents}
    return tuple(effect for effect in effects if effect in found or effect.name in parents)


def _stands_for_itself(effect: Effect) -> bool:
    """Return True for periodic and position-periodic effects, and those that are no push at a joint, a drive or a sensor."""
    return effect.pulsation is not None or effect.wave_number is not None or not effect.is_push


def _is_late(effect: Effect) -> bool:
    return effect.family is Family.DELAY_OR_LAG


def _by_place(context: FitContext, suspects: Sequence[Suspect]) -> dict[str, float]:
    shares: dict[str, float] = {}
    for suspect in suspects:
        place = context.rig.acts_at(suspect.effect)
        shares[place] = max(shares.get(place, 0.0), suspect.share)
    return shares
