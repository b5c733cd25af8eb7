"""What is known of a model's gap: what its diagnosis wrote, or what it leaves on a campaign that it is known to hold for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from rigsight.compare import KnownGap, OwnNumber, free_run, own_numbers
from rigsight.compare.on_one_record import FreeRun
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.errors import InputError
from rigsight.identify import mean_square_freedom
from rigsight.identify.fit.windows import cut, window_length
from rigsight.metrics import rms
from rigsight.records import Record
from rigsight.simulate.equilibrium import can_drift
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.model_file import MODEL_FILE, json_object
from rigsight.workflow.run.results import DIAGNOSIS_FILE

_MEND = "Run 'rigsight diagnose' again, or name the campaign of the model with --campaign."
_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


@dataclass(frozen=True)
class Reference:
    """What is known of a model's gap."""

    floors: Mapping[str, float]  # noise floor of each output, in its unit
    known: tuple[KnownGap, ...]  # of the records for which the model is known to hold; empty without such
    # Change of each number that each of these records asks for; empty where that is not known.
    numbers: tuple[tuple[OwnNumber, ...], ...]
    # Length [s] of the windows that are simulated from states of their own, None for whole records.
    window: float | None

    def windows(self, record: Record) -> tuple[Record, ...]:
        """Return a record as it is simulated."""
        return cut([record], self.window)


class _Floor(BaseModel):
    std: _Positive


class _RecordGap(BaseModel):
    record: str
    output: str
    rms: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    freedom: _Positive
    duration: _Positive
    measured_rms: _Positive


class _Number(BaseModel):
    record: str
    name: str
    value: _Finite
    unit: str
    change: _Finite
    information: _Positive
    noise: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class _Diagnosis(BaseModel):
    """What a gate reads of ``diagnosis.json``."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    rig: str
    noise_floor: dict[str, _Floor]
    gap_by_record: Annotated[list[_RecordGap], Field(min_length=1)]
    numbers_by_record: list[_Number]
    window: _Positive | None = None
    observer_bandwidth: float | None = None


def beside(model: Path) -> Path | None:
    """Return the diagnosis that wrote a model; None if there is none."""
    folder = model if model.is_dir() else model.parent
    file = folder / DIAGNOSIS_FILE
    is_of_one = model.is_dir() or model.name == MODEL_FILE
    return file if is_of_one and file.is_file() else None


def of_diagnosis(file: Path, model: Model) -> Reference:
    """Return what a diagnosis wrote."""
    try:
        found = _Diagnosis.model_validate(json_object(file, "diagnosis", _MEND))
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        key = ".".join(map(str, problem["loc"]))
        raise InputError(
            f"{file}: {key}: {problem['msg'][0].lower()}{problem['msg'][1:]}; this version of rigsight needs it. {_MEND}"
        ) from None
    if found.rig != model.structure.rig.name:
        raise InputError(
            f"{file} is of the rig '{found.rig}', the model of '{model.structure.rig.name}'. {_MEND}"
        )
    if found.observer_bandwidth is not None:
        raise InputError(
            f"{file}: an observer followed the motion, which no free run can be compared with. Name records for which "
            "the model is known to hold with --campaign."
        )
    known = tuple(
        KnownGap(own.record, own.output, own.rms, own.freedom, own.duration, own.measured_rms)
        for own in found.gap_by_record
    )
    numbers: dict[str, list[OwnNumber]] = {}
    for one in found.numbers_by_record:
        own = OwnNumber(one.name, one.value, one.unit, one.change, one.information, one.noise)
        numbers.setdefault(one.record, []).append(own)
    floors = {name: floor.std for name, floor in found.noise_floor.items()}
    return Reference(floors, known, tuple(map(tuple, numbers.values())), found.window)


def of_records(model: Model, records: Sequence[Record], are_known: bool) -> Reference:
    """Return the floors of records, and where the model is known to hold for them, its gaps."""
    rig = model.structure.rig
    drifts = can_drift(rig, model.values)
    floors = {floor.output: floor.std for floor in noise_floors(rig, records, drifts)}
    reference = Reference(floors, (), (), window_length(rig, records) if drifts else None)
    if not are_known:
        return reference
    known = [
        gap
        for record in records
        for gap in known_gaps(record, free_run(model, record, reference.windows(record), floors))
    ]
    numbers = [own_numbers(model, reference.windows(record), floors) for record in records]
    return Reference(floors, tuple(known), tuple(map(tuple, numbers)), reference.window)


def known_gaps(record: Record, run: FreeRun) -> list[KnownGap]:
    """Return the gap of a model in each output of a record."""
    return [
        KnownGap(
            record.name,
            output,
            rms(residual),
            mean_square_freedom(residual),
            record.n_samples * record.dt,
            float(np.std(record[output])),
        )
        for output, residual in run.residuals.items()
    ]
