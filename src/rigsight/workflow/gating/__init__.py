"""Which records does a gate ask, what is known of the gap of their model, and how large may it be?

Known is what the diagnosis of the model wrote, or what it leaves on a campaign that it is known to hold for. The limit is the one
that was asked for, else what a record exceeds rarely if the model holds.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field

from rigsight.compare import KnownGap, NumberCheck, OwnNumber, UsualGap, check_numbers, free_run, own_numbers
from rigsight.compare.on_one_record import FreeRun
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.effects import Effect
from rigsight.errors import InputError, nearest
from rigsight.identify import mean_square_freedom
from rigsight.identify.fit.windows import cut, window_length
from rigsight.metrics import rms
from rigsight.records import Record
from rigsight.records.channel_units import UnknownUnitError, conversion
from rigsight.records.read_record import read_stretches
from rigsight.rigs import Rig
from rigsight.simulate.equilibrium import can_drift
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.campaign_file import RecordTable, locate, read_campaign_table
from rigsight.workflow.campaign.model_file import MODEL_FILE, of_this_rig, part_of_diagnosis
from rigsight.workflow.campaign.read_campaign import free_name, options_of, read_campaign, read_listed_record
from rigsight.workflow.campaign.record_notes import in_units_of
from rigsight.workflow.run.results import DIAGNOSIS_FILE

_MEND = "Run 'rigsight diagnose' again, or name the campaign of the model with --campaign."
_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
FALSE_ALARMS = 0.05
"""Probability that true records close the gate: of all records, sensors and numbers of a run together (Bonferroni)."""
_OF_GAPS = 0.5
"""Share of it for gaps; the rest is for changed numbers."""
_FARTHER = 0.1
"""Share by which noise and another draw of the same input may move a sensor farther."""
_LIMIT = re.compile(
    r"(?P<output>[^=]+)=\s*(?P<value>[-+]?[\d.]+(?:[eE][-+]?\d+)?(?![\d,._])|\S+)\s*(?P<unit>.*)"
)
_OF_ITS_OWN = {"name": None, "start": None, "end": None, "amplitude": None, "role": "validation"}
"""What the first record of a campaign says of itself and not of others."""


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


class _Diagnosis(BaseModel, frozen=True):
    """What a gate reads of ``diagnosis.json``."""

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
    found = part_of_diagnosis(file, _Diagnosis, _MEND, "; this version of rigsight needs it")
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
    return Reference(floors, tuple(known), tuple(tuple(own) for own in numbers if own), reference.window)


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


@dataclass(frozen=True)
class Check:
    """The gap of one sensor in one record."""

    record: str
    output: str
    unit: str
    gap: float  # RMS of measured minus simulated; infinite where the model cannot be simulated
    floor: float  # noise floor of the sensor
    limit: float
    usual: float | None  # RMS of a record for which the model is known to hold; None where none is known
    p_value: float | None  # probability of such a gap if the model holds; None where the limit was asked for
    # True where the sensor moves more than in any record for which the model is known to hold.
    beyond: bool = False

    @property
    def closed(self) -> bool:
        """True if the gap exceeds the limit."""
        return self.gap > self.limit

    @property
    def excess(self) -> float:
        """The gap in units of the limit."""
        return self.gap / self.limit if self.limit > 0.0 else math.inf


@dataclass(frozen=True)
class Limits:
    """The limits that were asked for."""

    floors: float | None = None  # for every sensor, in noise floors
    of_outputs: Mapping[str, float] = field(default_factory=dict)  # in the units of the sensors

    @classmethod
    def read(cls, floors: float | None, texts: Iterable[str], rig: Rig) -> Limits:
        """Return limits from what was written on a command line: ``psi=0.002 rad``."""
        if floors is not None and not (math.isfinite(floors) and floors > 0.0):
            raise InputError(f"--floors must be a positive number, got {floors:g}.")
        limits = dict[str, float]()
        for text in texts:
            output, value = _limit(text, rig)
            if output in limits:
                raise InputError(f"--limit '{text}': '{output}' is limited twice; give one value.")
            limits[output] = value
        return cls(floors, limits)

    def asked(self, output: str, floor: float) -> float | None:
        """Return the limit that was asked for; None if there is none."""
        if output in self.of_outputs:
            return self.of_outputs[output]
        return None if self.floors is None else self.floors * floor


def gap_check(gap: KnownGap, rig: Rig, limits: Limits, reference: Reference, n_tested: int) -> Check | None:
    """Return the check of one of so many gaps without a limit that was asked for; None where nothing limits it."""
    floor = reference.floors[gap.output]
    usual = UsualGap.of(reference.known, gap.output)
    limit, p_value = limits.asked(gap.output, floor), None
    if limit is None:
        if usual is None:
            return None
        limit = usual.limit(gap.duration, _OF_GAPS * FALSE_ALARMS / n_tested)
        p_value = usual.p_value(gap.rms, gap.duration)
    return Check(
        gap.record,
        gap.output,
        rig.signal_units[gap.output],
        gap.rms,
        floor,
        limit,
        None if usual is None else usual.center,
        p_value,
        usual is not None and gap.moved > usual.farthest * (1.0 + _FARTHER),
    )


def number_checks(
    model: Model, record: Record, limits: Limits, reference: Reference, n_records: int
) -> list[NumberCheck]:
    """Return the checks of the numbers of a record: where their scatter is known, and no other limit was asked for."""
    if not reference.numbers or limits.floors is not None or limits.of_outputs:
        return []
    own = own_numbers(model, reference.windows(record), reference.floors)
    each = (1.0 - _OF_GAPS) * FALSE_ALARMS / max(1, len(own) * n_records)
    return check_numbers(record.name, own, reference.numbers, each)


def _limit(text: str, rig: Rig) -> tuple[str, float]:
    found = _LIMIT.fullmatch(text.strip())
    if found is None:
        raise InputError(
            f"--limit '{text}' cannot be read; write SENSOR=VALUE UNIT, for instance psi=0.002 rad."
        )
    output, unit = found["output"].strip(), found["unit"].strip()
    units = {signal.name: signal.unit for signal in rig.outputs}
    if output not in units:
        raise InputError(
            f"--limit '{text}': {rig.name} has no sensor '{output}'.{nearest(output, units)} Its sensors: {', '.join(units)}."
        )
    try:
        value = float(found["value"]) * (conversion(unit, units[output])[0] if unit else 1.0)
    except UnknownUnitError as error:
        raise InputError(
            f"--limit '{text}': the unit '{unit}' {error}. Write it in {units[output]}."
        ) from None
    except ValueError:
        raise InputError(f"--limit '{text}': '{found['value']}' is not a number.") from None
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"--limit '{text}': must be a positive number.")
    return output, value


@dataclass(frozen=True)
class Reader:
    """Reads records of the rig of a model."""

    model: Model
    campaign: Path | None  # of which the first record says how files are read
    own_effects: Sequence[Effect]
    own_rigs: Sequence[Rig]

    def read(self, paths: Sequence[str | Path]) -> list[Record]:
        """Return the records of campaigns and files, with names of their own."""
        named: dict[str, Record] = {}
        for record in (record for path in paths for record in self._of(Path(path))):
            name = free_name(record.name, named)
            named[name] = replace(record, name=name)
        return list(named.values())

    def of_campaign(self, path: Path) -> tuple[Record, ...]:
        """Return all records of a campaign."""
        campaign = read_campaign(path, self.own_effects, self.own_rigs)
        of_this_rig("MODEL", self.model, campaign)
        return campaign.records

    def _of(self, path: Path) -> Sequence[Record]:
        if not path.exists():
            raise InputError(
                f"{path} does not exist; name a campaign.toml, the folder that contains it, or a measured file."
            )
        if path.is_dir() or path.suffix == ".toml":
            return self.of_campaign(path)
        rig = self.model.structure.rig
        if self.campaign is None:
            read = read_stretches(
                path, rig.inputs, rig.outputs, replace(options_of(rig), hold=self.model.hold)
            )
        else:
            read = self._as_in_campaign(self.campaign, path)
        return [in_units_of(rig, record) for record in read]

    def _as_in_campaign(self, campaign: Path, path: Path) -> tuple[Record, ...]:
        toml = locate(campaign)
        table, where = read_campaign_table(toml)
        first: RecordTable = table.records[0].model_copy(update={**_OF_ITS_OWN, "file": path.name})
        joined = [
            column
            for column in first.columns.values()
            if not isinstance(column, str | int) and column.file is not None
        ]
        if joined:
            raise InputError(
                f"{where.at('records', 0, 'columns')}: takes signals from further files, so {path.name} alone is no record. Give "
                "the new records as a campaign.toml."
            )
        records = read_listed_record(
            toml, self.model.structure.rig, 1, first, path, where, table.rig.constants
        )
        outputs = [signal.name for signal in self.model.structure.rig.outputs]
        if table.offsets == "per_record":
            return tuple(record.with_free_offsets(outputs) for record in records)
        return records
