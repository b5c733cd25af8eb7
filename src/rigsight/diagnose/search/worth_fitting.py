"""Which effects at which places are fitted alone? Those to which the screening or the missing force along the motion points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.screening import Shortlist, Suspect
from rigsight.effects import Effect, Family
from rigsight.identify.fit.windows import Windowing
from rigsight.inverse import Proposal, ProposedStart
from rigsight.inverse.selection import WORTH
from rigsight.rigs import Rig


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
    is_late = any(is_delay_or_lag(effect) for effect in effects if effect.name == suspected)
    everywhere = [effect for effect in effects if is_late and is_delay_or_lag(effect)]
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


def is_delay_or_lag(effect: Effect) -> bool:
    """Return True for a delay or a lag."""
    return effect.family is Family.DELAY_OR_LAG


def _by_place(context: FitContext, suspects: Sequence[Suspect]) -> dict[str, float]:
    shares: dict[str, float] = {}
    for suspect in suspects:
        place = context.rig.acts_at(suspect.effect)
        shares[place] = max(shares.get(place, 0.0), suspect.share)
    return shares


@dataclass(frozen=True)
class WorthFitting:
    """The effects that are fitted alone; all candidates are tried as a further cause."""

    alone: tuple[Effect, ...] = ()
    named: tuple[Effect, ...] = ()  # of those alone the ones of families that the motion names
    # Whether the motion shows every force that matters: a family that it rules out is not the main cause.
    is_shown: bool = False
    # Names of effects that only fits can judge beside the gain of their drive.
    undecided: frozenset[str] = frozenset()
    explained: float = 0.0  # share of the missing force that one family explains, or all that were taken
    # Of effects by their names: where they explain most of the missing force along the motion.
    starts: Mapping[str, ProposedStart] = field(default_factory=dict)
    # Whether the user named the candidates: all of them are fitted, whatever the motion says of them.
    are_chosen: bool = False


def worth_fitting(rig: Rig, proposal: Proposal | None, effects: Sequence[Effect]) -> WorthFitting:
    """Return the effects of families that the proposal took or that explain nearly as much, and those that it does not judge."""
    # These may be the main cause; a weaker one beside it is searched for among all. All of them where no family alone explains
    # enough to exclude others.
    if proposal is None or not proposal.alone:
        return WorthFitting(tuple(effects))
    everything = WorthFitting(tuple(effects), starts=proposal.starts)
    most, (least, _) = proposal.alone[0].share, proposal.alone[0].interval
    if least < SEARCH.decisive_force or most < proposal.by_chance:
        return everything
    near = {(c.family, c.where) for c in proposal.alone if c.share >= SEARCH.near_force * most}
    near |= {(cause.family, cause.where) for cause in proposal.taken}
    refined = _needless_refinements(effects, proposal.starts)
    named = tuple(
        e
        for e in effects
        if e.name in proposal.judged and (e.family, rig.where(e)) in near and e.name not in refined
    )
    is_shown = proposal.noise is not None and proposal.noise < SEARCH.noise_of_force
    beside = (proposal.explained - most) / (1.0 - most) if most < 1.0 else 0.0
    is_rich = proposal.by_chance < VERDICT.larger_part
    if is_shown and is_rich and min(beside, proposal.explained) >= VERDICT.larger_part:
        # No family alone follows the motion: other forms are tried beside the families that explain it together.
        named = proposal.effects
    if any(map(is_delay_or_lag, named)):
        # What is late in one place makes all readings behind it late, as in the screening.
        named += tuple(
            e for e in effects if is_delay_or_lag(e) and e.name in proposal.judged and e not in named
        )
    # A weight is a ripple of one period a turn, with one number less.
    rippled = {rig.where(e) for e in named if e.wave_number is not None and e.torque is not None}
    named += tuple(e for e in effects if e.turns_freely and rig.where(e) in rippled and e not in named)
    kept = tuple(e for e in effects if e.name not in proposal.judged or e in named)
    most = max(most, proposal.explained)
    return WorthFitting(kept, named, is_shown, proposal.undecided, most, proposal.starts)


def _needless_refinements(effects: Sequence[Effect], starts: Mapping[str, ProposedStart]) -> set[str]:
    """Return the names of forms of forms, such as LuGre friction, that leave hardly less along the motion than simpler ones."""
    # A form of another family is another cause: a loop is fitted beside the presliding friction that it contains.
    families = {effect.name: effect.family for effect in effects}
    parents = {
        effect.name: [
            name for name in effect.parents if name in starts and families.get(name) == effect.family
        ]
        for effect in effects
    }
    found = set()
    for name, simpler in parents.items():
        if name in starts and any(parents.get(parent) for parent in simpler):
            least = min(starts[parent].unexplained for parent in simpler)
            if starts[name].unexplained > (1.0 - WORTH) * least:
                found.add(name)
    return found


@dataclass(frozen=True)
class SingleModels:
    """Models with at most one effect, fitted and scored on the same records."""

    windowing: Windowing  # how records were cut
    context: FitContext  # records, scales and noise
    # The given simulation, and its equations with refitted parameters.
    before: FittedModel
    reidentified: FittedModel
    singles: list[FittedModel]  # every effect by itself
    search: Search  # where and for which effects was searched
    # What the motion says of the missing force before any fit; None where the sensors do not show the motion.
    proposal: Proposal | None
    effects: tuple[Effect, ...]  # all candidates
    worth: WorthFitting  # those that may be the main cause
    # All causes that the motion names, fitted together; None where it does not show the force or names fewer than two.
    together: FittedModel | None

    @property
    def named(self) -> frozenset[tuple[Family, str]]:
        """Families at their places that the motion names, where it shows the force."""
        if not self.worth.is_shown or self.proposal is None:
            return frozenset()
        named = {(cause.family, cause.where) for cause in self.proposal.taken}
        if any(family is Family.DELAY_OR_LAG for family, _ in named):
            # What is late elsewhere makes the same readings late.
            late = filter(is_delay_or_lag, self.worth.named)
            named |= {(effect.family, self.context.rig.where(effect)) for effect in late}
        return frozenset(named)
