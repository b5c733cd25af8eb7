"""What did a diagnosis find, or what do the records of a campaign give?

Numbers with their errors and their scatter between records, read from the folder of a diagnosis or of an identification.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field

from rigsight.campaign import Campaign
from rigsight.compare.usual_gap import Prediction
from rigsight.diagnose.trust.patterns import Role, roles
from rigsight.effects import Effect, Family
from rigsight.errors import InputError
from rigsight.identify.identification import Identification
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose
from rigsight.workflow.campaign.model_file import part_of_diagnosis, read_model
from rigsight.workflow.run.results import DIAGNOSIS_FILE

_MEND = "Name folders that 'rigsight diagnose' wrote, or campaigns."
_Number = Annotated[float, Field(allow_inf_nan=False)]


@dataclass(frozen=True)
class Known:
    """A number that a diagnosis found."""

    value: float
    std: float  # infinite where its records do not determine it
    between: float  # variance between its records beyond their errors; 0 where that is not known
    n_records: int  # number of records that determine it alone
    entangled: tuple[str, ...]  # numbers from which its records can hardly separate it

    @property
    def with_scatter(self) -> float:
        """Standard error that includes the scatter between records."""
        return float(np.sqrt(self.std**2 + self.between / max(1, self.n_records)))


@dataclass(frozen=True)
class Unit:
    """What a diagnosis found."""

    name: str
    rig: str
    effects: tuple[str, ...]  # with ``@place`` where the rig has several
    numbers: Mapping[str, Known]
    units: Mapping[str, str]
    roles: Mapping[str, Role | Family]  # of each number in the equations, the family for one of an effect
    # Largest error of its equations in one record, in words; empty where it is noise, and for a diagnosis.
    remainder: str = ""

    @property
    def has_one_record(self) -> bool:
        """Whether its records do not show how far the numbers of one record differ from those of another."""
        return max((own.n_records for own in self.numbers.values()), default=0) < 2


class _Estimate(BaseModel):
    value: _Number
    std: _Number | None
    unit: str


class _Candidate(BaseModel):
    effects: list[str]
    where: list[str]
    parameters: dict[str, _Estimate]


class _Group(BaseModel):
    value: _Number
    std: _Number | None


class _Parameter(BaseModel):
    name: str
    by_group: dict[str, list[_Group]]


class _Pair(BaseModel):
    names: list[str]


class _Trust(BaseModel):
    parameters: list[_Parameter]
    entangled: list[_Pair]


class _Diagnosis(BaseModel, frozen=True):
    """What is read of ``diagnosis.json``."""

    title: str
    rig: str
    effects: list[str]
    where: list[str]
    candidates: list[_Candidate]
    trust: _Trust | None


def refuse_other_rigs(rigs: Mapping[str, str]) -> None:
    """Raise InputError if those of these names have different rigs."""
    first, *others = rigs.items()
    for name, rig in others:
        if rig != first[1]:
            raise InputError(
                f"{first[0]} is of the rig '{first[1]}', {name} of '{rig}': only those of one rig can be compared."
            )


def read_unit(folder: Path, own_effects: Iterable[Effect], own_rigs: Iterable[Rig]) -> Unit:
    """Return what a diagnosis found, by its folder."""
    file = folder / DIAGNOSIS_FILE
    if folder.is_file():
        raise InputError(
            f"{folder} is neither a campaign nor a folder: name the folder of the results, {folder.parent}."
        )
    if not file.is_file():
        raise InputError(f"{folder} contains neither {DIAGNOSIS_FILE} nor campaign.toml. {_MEND}")
    found = part_of_diagnosis(file, _Diagnosis, _MEND)
    model = read_model(folder, own_effects, own_rigs)
    own = [one for one in found.candidates if one.effects == found.effects]
    candidate = next((one for one in own if one.where == found.where), own[0] if own else None)
    if candidate is None:
        raise InputError(f"{file}: candidates: none has the effects of the verdict. {_MEND}")
    return _unit(
        str(folder),
        found.rig,
        model.structure,
        {name: _read_number(name, estimate, found.trust) for name, estimate in candidate.parameters.items()},
        {name: estimate.unit for name, estimate in candidate.parameters.items()},
    )


def _unit(
    name: str, rig: str, structure: Structure, numbers: Mapping[str, Known], units: Mapping[str, str]
) -> Unit:
    families = {
        structure.parameter_name(effect, p.name): effect.family
        for effect in structure.effects
        for p in effect.parameters
    }
    return Unit(name, rig, structure.effect_names, numbers, units, {**roles(structure.rig, []), **families})


def _read_number(name: str, estimate: _Estimate, trust: _Trust | None) -> Known:
    parameters = [] if trust is None else [p for p in trust.parameters if p.name == name]
    alone = [(g.value, g.std) for p in parameters for g in p.by_group.get("record", [])]
    pairs = [] if trust is None else [pair.names for pair in trust.entangled if name in pair.names]
    entangled = tuple(other for names in pairs for other in names if other != name)
    return _known(estimate.value, np.inf if estimate.std is None else estimate.std, alone, entangled)


def _known(
    value: float, std: float, alone: Iterable[tuple[float, float | None]], entangled: tuple[str, ...] = ()
) -> Known:
    """Return a number with what each record alone gives, with its standard error."""
    determined = [(own, error**2) for own, error in alone if error is not None and 0.0 < error < np.inf]
    between = 0.0
    if len(determined) > 1:
        between = Prediction.of(*map(np.array, zip(*determined, strict=True))).between
    return Known(value, std, between, len(determined), entangled)


def unit_of_records(name: str, campaign: Campaign, identification: Identification) -> Unit:
    """Return what the records of a campaign give: one set of numbers for all records, and a fit of each alone."""
    joint, fit = identification.joint, identification.joint.fit

    def known(number: str) -> Known:
        alone = [(k.fit.values[number], k.fit.standard_errors.get(number)) for k in fit.kinds]
        return _known(fit.fit.values[number], fit.fit.standard_errors[number], alone)

    return _unit(
        name,
        campaign.rig.name,
        compose(campaign.rig, campaign.modelled),
        {number: known(number) for number in joint.names},
        {number: identification.units[number] for number in joint.names},
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
        if added:
            campaign = replace(campaign, modelled=modelled, parameters={**own, **campaign.parameters})
    return campaign
