"""What do the records of a unit give? Numbers of an identification with their errors and their scatter between records."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigsight.campaign import Campaign
from rigsight.compare.usual_gap import Prediction
from rigsight.diagnose.trust.patterns import roles
from rigsight.effects import Effect
from rigsight.identify.identification import Identification
from rigsight.simulate import compose
from rigsight.workflow.differing.units import Known, Unit


def unit_of_records(name: str, campaign: Campaign, identification: Identification) -> Unit:
    """Return what the records of a campaign give by an identification of its rig.

    Parameters
    ----------
    name
        Of the unit.
    campaign
        Its records and rig.
    identification
        One set for all records, and a fit of each alone.
    """
    structure = compose(campaign.rig, campaign.modelled)
    families = {
        structure.parameter_name(effect, p.name): effect.family
        for effect in structure.effects
        for p in effect.parameters
    }
    joint = identification.joint
    return Unit(
        name,
        campaign.rig.name,
        structure.effect_names,
        {number: _known(number, identification) for number in joint.names},
        {number: identification.units[number] for number in joint.names},
        {**roles(structure.rig, []), **families},
    )


def with_effects_of(
    campaign: Campaign, models: Iterable[tuple[Sequence[Effect], Mapping[str, float]]]
) -> Campaign:
    """Return a campaign whose model has the effects of all these models, each with the values where it was first."""
    for effects, values in models:
        names = {effect.name for effect in campaign.modelled}
        added = tuple(effect for effect in effects if effect.name not in names)
        modelled = (*campaign.modelled, *added)
        own = {p.name: values[p.name] for p in compose(campaign.rig, modelled).parameters if p.name in values}
        campaign = (
            replace(campaign, modelled=modelled, parameters={**own, **campaign.parameters})
            if added
            else campaign
        )
    return campaign


def _known(name: str, identification: Identification) -> Known:
    fit = identification.joint.fit
    alone = [(kind.fit.values[name], kind.fit.standard_errors.get(name, np.inf)) for kind in fit.kinds]
    alone = [(value, error**2) for value, error in alone if 0.0 < error < np.inf]
    between = Prediction.of(*map(np.array, zip(*alone, strict=True))).between if len(alone) > 1 else 0.0
    return Known(fit.fit.values[name], fit.fit.standard_errors[name], between, len(alone), ())
