"""The work of `rigsight power`: a campaign -> the smallest size of each effect that its records would have named."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import start_values_of
from rigsight.effects import CATALOGUE, Effect, kind_of
from rigsight.errors import InputError
from rigsight.inverse import NAMED_IN, NamedSize, along_motion, named_sizes
from rigsight.json_data import json_data
from rigsight.rigs import Rig
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.own.own_effects import candidates_of
from rigsight.workflow.run.progress import Listener, Stage, report_notes, silent
from rigsight.workflow.run.results import check_writable, json_text, write_together

SCHEMA_VERSION = 1
POWER_FILE = "power.json"
FOUND_BY = (
    "The effect is added to the force along the measured motion of the estimation records, as they are, and the families are "
    "selected again. It counts as named if its family comes first beside those that the records show already, at its place or at "
    "another one that does the same."
)


@dataclass(frozen=True)
class Power:
    """What the records of a campaign would have named."""

    title: str
    sizes: tuple[NamedSize, ...]  # by effect and place

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``power.json``."""
        return {
            "schema_version": SCHEMA_VERSION,
            "title": self.title,
            "probability": NAMED_IN,
            "found_by": FOUND_BY,
            "effects": [_entry(size) for size in self.sizes],
        }


def run_power(
    campaign: str | Path,
    out: Path,
    *,
    effects: Sequence[Effect] = CATALOGUE,
    own_effects: Sequence[Effect] = (),
    own_rigs: Iterable[Rig] = (),
    seed: int = 0,
    listener: Listener = silent,
) -> Power:
    """Return the smallest size of each effect that would have been named, and write it into a folder."""
    check_writable(out, POWER_FILE)
    found = power_of(read_campaign(campaign, own_effects, own_rigs), effects, seed, listener)
    write_together(out, {POWER_FILE: json_text(found.to_json())})
    return found


def power_of(
    campaign: Campaign, effects: Sequence[Effect] = CATALOGUE, seed: int = 0, listener: Listener = silent
) -> Power:
    """Return the smallest size of each effect that a campaign would have named."""
    report_notes(campaign.notes, listener)
    if not campaign.estimation:
        raise InputError('This needs at least one record with role = "estimation".')
    candidates = candidates_of(campaign, effects)
    stage = Stage("Adding effects", 1 + len(candidates), listener)
    terms = along_motion(campaign, {**campaign.constants, **start_values_of(campaign), **campaign.given})
    stage.finished("motion")
    if terms is None:
        raise InputError(
            f"The sensors of these records do not show the whole motion of {campaign.rig.name}, or an effect that the simulation "
            "has already acts at a drive or a sensor: nothing can be added along the motion. Measure every coordinate, or draw "
            "trials with 'rigsight blind'."
        )
    asked = {kind_of(effect.name) for effect in effects}
    known = [
        NamedSize(
            kind_of(e.name), e.family, campaign.rig.where(e), {}, "The simulation has this effect already."
        )
        for e in campaign.modelled
        if kind_of(e.name) in asked
    ]
    return Power(campaign.title, (*named_sizes(terms, candidates, seed, stage.finished), *known))


def _entry(size: NamedSize) -> dict[str, Any]:
    parameters = {name: {"value": value, "unit": unit} for name, (value, unit) in size.parameters.items()}
    first = next(iter(parameters), None)
    entry = {
        "effect": size.effect,
        "family": str(size.family),
        "where": size.where,
        "size": None if first is None else {"parameter": first, **parameters[first]},
        "parameters": parameters,
        "reason": size.reason or None,
    }
    return dict(json_data(entry))
