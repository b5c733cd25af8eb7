"""Which effects are worth a fit, alone and together, after what the motion says of the missing force?"""

from __future__ import annotations

from collections.abc import Sequence

from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.effects import Effect
from rigsight.inverse import Proposal
from rigsight.rigs import Rig


def worth_fitting(rig: Rig, proposal: Proposal | None, effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return the effects of families that the proposal took or that explain nearly as much, and those that it does not judge.

    All of them where no family alone explains enough to exclude others.
    """
    if proposal is None or not proposal.alone:
        return tuple(effects)
    most = proposal.alone[0].share
    if most < max(SEARCH.decisive_force, proposal.by_chance):
        return tuple(effects)
    near = {(c.family, c.where) for c in proposal.alone if c.share >= SEARCH.near_force * most}
    near |= {(cause.family, cause.where) for cause in proposal.taken}
    return tuple(e for e in effects if e.name not in proposal.judged or (e.family, rig.where(e)) in near)


def worth_combining(proposal: Proposal | None, effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return the effects that are worth a fit beside others: those that the proposal took and those that it does not judge.

    All of them where none was taken, or those that were leave no larger part of the missing force above noise. Where they do, no
    set of the others explains the records either: the regression along the motion had all sets of them to choose from.
    """
    if proposal is None or proposal.noise is None or not proposal.taken:
        return tuple(effects)
    above_noise = 1.0 - proposal.explained - proposal.noise
    if above_noise < VERDICT.larger_part * (1.0 - proposal.noise):
        return tuple(effects)
    taken = {cause.effect.name for cause in proposal.taken}
    return tuple(e for e in effects if e.name not in proposal.judged or e.name in taken)
