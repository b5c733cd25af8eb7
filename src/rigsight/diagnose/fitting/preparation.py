"""Preparation of the fits of a campaign: records, scales, start values, and which parameters are held."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from rigsight.campaign import Campaign
from rigsight.diagnose.fitting.fit_context import FitContext
from rigsight.diagnose.policy import HORIZON
from rigsight.identify import (
    FitMemory,
    IdleThreads,
    characteristic_scales,
    linear_start,
    swallowed_by_offsets,
)
from rigsight.identify.fit.windows import Observer, Windowing, followed_sensors, liveliest, until_rest
from rigsight.inverse import numbers_along_motion
from rigsight.simulate import Structure, compose, structure_of_fit

Prepare = Callable[[Sequence[Structure]], None]
"""Called with the structures that are about to be simulated, to compile them side by side."""


def fit_context_of(
    campaign: Campaign,
    noise: Mapping[str, float],
    windowing: Windowing,
    memory: FitMemory | None,
    threads: IdleThreads,
    start: Mapping[str, float],
) -> FitContext:
    """Return the context in which candidates of a campaign are fitted and scored."""
    fitted = windowing.cut(campaign.estimation)
    moving = until_rest(fitted, campaign.rig)
    held = _held(campaign)
    asked = [p.name for p in campaign.rig.parameters if p.name not in held]
    scales = characteristic_scales(campaign.rig, campaign.estimation, start)
    held |= frozenset(
        swallowed_by_offsets(compose(campaign.rig), campaign.estimation, scales, noise, start, asked)
    )
    return FitContext(
        rig=campaign.rig,
        estimation=fitted,
        look=liveliest(moving, campaign.rig, HORIZON.examined),
        scoring=windowing.cut(campaign.validation or campaign.estimation),
        scales=scales,
        noise=noise,
        held=held,
        start=start,
        given=campaign.given,
        modelled=campaign.modelled,
        memory=memory,
        threads=threads,
    )


def structures_to_fit(campaign: Campaign, structures: Iterable[Structure]) -> list[Structure]:
    """Return structures as they are simulated in fits to the records of a campaign: with free offsets and with an observer."""
    sensors = followed_sensors(campaign.rig, campaign.records) if campaign.drifts else ()
    records = Observer(sensors, bandwidth=0.0).following(campaign.records)
    return [structure_of_fit(structure, records) for structure in structures]


def start_values_of(campaign: Campaign) -> dict[str, float]:
    """Return values of all constants and parameters before any fit."""
    held = {} if campaign.absent_spring is None else {campaign.absent_spring: 0.0}
    if campaign.open_factor is not None:
        held[campaign.open_factor.held] = campaign.open_factor.value
    rig, given = campaign.rig, {**campaign.constants, **campaign.given, **held}
    along = None
    if not rig.has_one_motion and all(p.name in given for p in rig.parameters):
        along = numbers_along_motion(campaign, given)
    start = {
        **campaign.constants,
        **(along or linear_start(rig, campaign.estimation, campaign.constants, held)),
    }
    # Numbers fitted without the effects that the simulation has are farther off than those it came with.
    return (
        {**start, **campaign.given}
        if campaign.modelled or campaign.rig.mechanism.bodies_are_nonlinear
        else start
    )


def _held(campaign: Campaign) -> frozenset[str]:
    """Return rig parameters that these records do not determine, and the stiffness of an absent spring."""
    held = set() if campaign.absent_spring is None else {campaign.absent_spring}
    if campaign.open_factor is not None:
        held.add(campaign.open_factor.held)
    if not campaign.rig.has_one_motion:
        return frozenset(held)
    unmeasured = [
        symbol
        for symbol in campaign.rig.downstream
        if not any(symbol.name in record for record in campaign.estimation)
    ]
    if unmeasured:
        held |= campaign.rig.downstream_parameters
    return frozenset(held)
