"""Which effects are worth a fit as the main cause, after what the motion says of the missing force?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.effects import Effect
from rigsight.inverse import Proposal, ProposedStart
from rigsight.inverse.selection import WORTH
from rigsight.rigs import Rig


@dataclass(frozen=True)
class WorthFitting:
    """The effects that are fitted alone; all candidates are tried as a further cause."""

    alone: tuple[Effect, ...] = ()
    named: tuple[Effect, ...] = ()  # of those alone the ones of families that the motion names
    # Whether the motion shows every force that matters: a family that it rules out is not the main cause.
    is_shown: bool = False
    explained: float = 0.0  # share of the missing force that one family explains, or all that were taken
    # Of effects by their names: where they explain most of the missing force along the motion.
    starts: Mapping[str, ProposedStart] = field(default_factory=dict)


def worth_fitting(rig: Rig, proposal: Proposal | None, effects: Sequence[Effect]) -> WorthFitting:
    """Return the effects of families that the proposal took or that explain nearly as much, and those that it does not judge.

    These may be the main cause; a weaker one beside it is searched for among all. All of them where no family alone explains
    enough to exclude others.
    """
    if proposal is None or not proposal.alone:
        return WorthFitting(tuple(effects))
    everything = WorthFitting(tuple(effects), starts=proposal.starts)
    most = proposal.alone[0].share
    if most < max(SEARCH.decisive_force, proposal.by_chance):
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
    kept = tuple(e for e in effects if e.name not in proposal.judged or e in named)
    return WorthFitting(kept, named, is_shown, max(most, proposal.explained), proposal.starts)


def _needless_refinements(effects: Sequence[Effect], starts: Mapping[str, ProposedStart]) -> set[str]:
    """Return the names of forms of forms, such as LuGre friction, that leave hardly less along the motion than simpler ones.

    A form of another family is another cause: a loop is fitted beside the presliding friction that it contains.
    """
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
