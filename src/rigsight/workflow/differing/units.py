"""What did a diagnosis find? Its numbers with their errors and their scatter between its records, read from its folder."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from rigsight.compare.usual_gap import Prediction
from rigsight.diagnose.trust.patterns import Role, roles
from rigsight.effects import Effect, Family
from rigsight.errors import InputError
from rigsight.rigs import Rig
from rigsight.workflow.campaign.model_file import json_object, read_model
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


class _Diagnosis(BaseModel):
    """What is read of ``diagnosis.json``."""

    model_config = ConfigDict(extra="ignore", frozen=True)

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
    if not file.is_file():
        raise InputError(f"{folder} contains neither {DIAGNOSIS_FILE} nor campaign.toml. {_MEND}")
    try:
        found = _Diagnosis.model_validate(json_object(file, "diagnosis", _MEND))
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        key = ".".join(map(str, problem["loc"]))
        raise InputError(f"{file}: {key}: {problem['msg'][0].lower()}{problem['msg'][1:]}. {_MEND}") from None
    model = read_model(folder, own_effects, own_rigs)
    own = [one for one in found.candidates if one.effects == found.effects]
    candidate = next((one for one in own if one.where == found.where), own[0] if own else None)
    if candidate is None:
        raise InputError(f"{file}: candidates: none has the effects of the verdict. {_MEND}")
    structure = model.structure
    families = {
        structure.parameter_name(effect, p.name): effect.family
        for effect in structure.effects
        for p in effect.parameters
    }
    return Unit(
        str(folder),
        found.rig,
        structure.effect_names,
        {name: _known(name, estimate, found.trust) for name, estimate in candidate.parameters.items()},
        {name: estimate.unit for name, estimate in candidate.parameters.items()},
        {**roles(structure.rig, []), **families},
    )


def _known(name: str, estimate: _Estimate, trust: _Trust | None) -> Known:
    groups = (
        [] if trust is None else [p.by_group.get("record", []) for p in trust.parameters if p.name == name]
    )
    alone = [(g.value, g.std**2) for own in groups for g in own if g.std is not None and g.std > 0.0]
    pairs = [] if trust is None else [pair.names for pair in trust.entangled if name in pair.names]
    between = Prediction.of(*map(np.array, zip(*alone, strict=True))).between if len(alone) > 1 else 0.0
    return Known(
        estimate.value,
        np.inf if estimate.std is None else estimate.std,
        between,
        len(alone),
        tuple(other for names in pairs for other in names if other != name),
    )
