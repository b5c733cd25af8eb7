"""Numbers of the base equations of a measured campaign, by regression along the measured motion, and what they leave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rigsight.campaign import Campaign
from rigsight.effects import Effect, effect_named, placed
from rigsight.errors import SimulationError
from rigsight.identify import characteristic_scales
from rigsight.inverse import (
    EquationFit,
    RecordMotion,
    held_numbers,
    identifiable,
    record_motions,
    size_in,
    undriven_inertias,
    with_all_inputs,
)
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate import compose

Floats = NDArray[np.float64]

FRICTION = "coulomb_friction"
_HELPS = 0.95
"""Share of the error of the equations without friction below which friction at a joint belongs to the base."""


@dataclass(frozen=True, eq=False)
class Base:
    """The base equations of a campaign with their numbers.

    Attributes
    ----------
    campaign
        The campaign.
    modelled
        Effects of the base equations: those of the campaign, or friction at a joint, or none.
    is_chosen
        True if the records chose them.
    values
        Constants, parameters and numbers of these effects by name.
    free
        Names of the numbers that the regression moves.
    remainder
        RMS of what they leave of each equation, in the band of the motion.
    without
        The same equations without the friction that was chosen, if one was.
    """

    campaign: Campaign
    modelled: tuple[Effect, ...]
    is_chosen: bool
    values: Mapping[str, float]
    free: tuple[str, ...]
    remainder: Floats
    without: Base | None = None

    @property
    def rig(self) -> Rig:
        """The rig."""
        return self.campaign.rig

    @cached_property
    def scales(self) -> dict[str, float]:
        """Size of each base quantity in the records."""
        own = {p.name: self.values[p.name] for p in (*self.rig.constants, *self.rig.parameters)}
        return characteristic_scales(
            self.rig, [with_all_inputs(self.rig, r) for r in self.campaign.estimation], own
        )

    def added(self, changed: Sequence[Record], reference: Sequence[Record]) -> float:
        """Return what a change of records adds to the error of the equations, in units of what they leave without it.

        What other numbers of the base equations would explain does not count. Of the equation in which most is added.

        Parameters
        ----------
        changed
            Records with an effect.
        reference
            The same stretches without it.
        """
        before, after = (
            EquationFit(
                self.rig,
                record_motions(self.rig, records, self.values),
                self.modelled,
                self.free,
                self.values,
            )
            for records in (reference, changed)
        )
        return float(np.max(before.unexplained(after, self.values, self.remainder) / self.remainder))

    def size(self, name: str) -> float:
        """Return the RMS of an input or a reading in the records.

        Parameters
        ----------
        name
            Of the signal.
        """
        signals = [record[name] for record in self.campaign.estimation if name in record]
        return float(np.sqrt(np.mean(np.concatenate(signals) ** 2))) if signals else 0.0


def base_of(campaign: Campaign) -> Base:
    """Return the base equations of a campaign, with friction at the joint where it lowers their error most, or nowhere.

    Parameters
    ----------
    campaign
        With records whose sensors show the whole motion.

    Raises
    ------
    SimulationError
        If they do not, or a number that no regression gives is missing.
    """
    rig = campaign.rig
    held = held_numbers(rig) | ({campaign.absent_spring} if campaign.absent_spring else set())
    known = {**campaign.constants, **campaign.given}
    missing = sorted(name for name in held if name not in known)
    if missing:
        raise SimulationError(f"The campaign does not give {', '.join(missing)}.")
    start = {p.name: p.default if p.default is not None else 1.0 for p in rig.parameters} | known
    motions = record_motions(rig, campaign.estimation, known)
    # An equation that no drive enters is solved by zeros: noise would pull its numbers there.
    held |= undriven_inertias(motions, start)
    undriven = sorted(name for name in held if name not in known and name in start and start[name] != 0.0)
    if undriven:
        raise SimulationError(f"The campaign does not give {', '.join(undriven)}.")
    free = identifiable(rig, motions, campaign.modelled, start, held)
    if campaign.modelled:
        return _fitted(campaign, motions, start, free, campaign.modelled, is_chosen=False)
    best = plain = _fitted(campaign, motions, start, free, (), is_chosen=False)
    for joint in rig.mechanism.joints:
        effect = effect_named(FRICTION)
        effect = effect if rig.has_one_motion else placed(effect, joint.name)
        if not rig.offers(placed(effect_named(FRICTION), joint.name)):
            continue
        found = _fitted(campaign, motions, start, free, (effect,), is_chosen=True)
        if size_in(found.remainder, plain.remainder) < min(_HELPS, size_in(best.remainder, plain.remainder)):
            best = found
    # Strengths are in units of what the better equations leave.
    return replace(best, without=replace(plain, remainder=best.remainder)) if best.is_chosen else best


def _fitted(
    campaign: Campaign,
    motions: Sequence[RecordMotion],
    start: Mapping[str, float],
    free: tuple[str, ...],
    modelled: tuple[Effect, ...],
    is_chosen: bool,
) -> Base:
    rig = campaign.rig
    structure = compose(rig, modelled)
    values = dict(start)
    if is_chosen:
        (effect,) = modelled
        name = structure.parameter_name(effect, "T_c")
        values[name], free = 0.0, (*free, name)
    values, remainder = EquationFit(rig, motions, modelled, free, values).settled(values)
    return Base(campaign, modelled, is_chosen, values, free, remainder)
