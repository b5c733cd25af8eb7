"""Which effects are worth a fit of their own, after what the motion says of the missing force?"""

from __future__ import annotations

from collections.abc import Sequence

from rigsight.diagnose.policy import SEARCH
from rigsight.effects import Effect
from rigsight.inverse import Proposal
from rigsight.rigs import Rig


def worth_fitting(rig: Rig, proposal: Proposal | None, effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return the effects of families that the proposal took or that explain nearly as much, and those that it does not judge.

    These may be the main cause; a weaker one beside it is searched for among all. All of them where no family
    alone explains enough to exclude others.
    """
    if proposal is None or not proposal.alone:
        return tuple(effects)
    most = proposal.alone[0].share
    if most < max(SEARCH.decisive_force, proposal.by_chance):
        return tuple(effects)
    near = {(c.family, c.where) for c in proposal.alone if c.share >= SEARCH.near_force * most}
    near |= {(cause.family, cause.where) for cause in proposal.taken}
    return tuple(e for e in effects if e.name not in proposal.judged or (e.family, rig.where(e)) in near)
