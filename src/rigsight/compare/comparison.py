"""Result of a comparison of many models on many records, as an object, as JSON and as a table with a row per score."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from scipy.signal import welch

from rigsight.compare.response_error import StepWindow
from rigsight.frequency import FrequencyResponse
from rigsight.identify.transfer.record_response import Method
from rigsight.json_data import json_data
from rigsight.metrics import rms
from rigsight.records import Floats, Record
from rigsight.simulate.model import Model

Quantity = Literal["magnitude_rmse", "phase_rmse", "magnitude_db", "step_rmse", "free_run_nrmse"]

QUANTITIES: dict[Quantity, str] = {
    "magnitude_rmse": "RMSE (5.1) of the magnitude of the frequency response",
    "phase_rmse": "RMSE (5.1) of its phase",
    "magnitude_db": "RMS of the ratio of simulated to measured magnitude in dB",
    "step_rmse": "RMSE after the step, with the offset before it removed",
    "free_run_nrmse": "RMS(measured - simulated) / RMS(measured - mean) in free run",
}

_SEGMENT = 256
"""Samples of a segment of Welch's method; a stretch that is shorter is one segment."""
SCHEMA_VERSION = 1
_HEAD = (
    "model", "record", "role", "kind", "amplitude", "signal", "quantity", "unit", "value",
    "noise_floor", "n_values", "best", "problem",
)  # fmt: skip
_EQUAL = 5e-4
"""Relative difference below which two errors are the same: they read alike in three digits."""


@dataclass(frozen=True)
class Column:
    """What is compared."""

    quantity: Quantity  # a key of `QUANTITIES`
    signal: str  # signal path (``"u -> psi"``) or output
    unit: str  # unit of the error


@dataclass(frozen=True)
class Score:
    """One error of one model on one record."""

    # Their names.
    model: str
    record: str
    column: Column  # what was compared
    value: float  # the error in the column's unit
    # What noise alone makes of it, in the same unit; None where the record does not show it.
    noise_floor: float | None
    n_values: int  # lines or samples that the error is of


@dataclass(frozen=True)
class Floor:
    """Noise floor of an output."""

    # Name of the output and its unit.
    output: str
    unit: str
    std: float  # standard deviation of what no model can explain
    method: str  # how it was found
    lower_bound: bool = False  # true if only part of the noise was seen
    # Pieces of noise alone, shape (n_samples,) each, with their sample time [s]. They give the spectrum of
    # the noise; without any it is taken for white.
    stretches: tuple[tuple[Floats, float], ...] = field(default=(), compare=False, repr=False)

    def noise(self, n_samples: int, dt: float, rng: np.random.Generator) -> Floats:
        """Return Gaussian noise of shape (n_samples,) with this standard deviation and the spectrum of the stretches."""
        white = rng.normal(size=n_samples)
        pieces = [(samples, step) for samples, step in self.stretches if np.ptp(samples) > 0.0]
        if not pieces:
            return self.std * white
        frequency = np.fft.rfftfreq(n_samples, dt)
        power = np.zeros_like(frequency)
        for samples, step in pieces:
            known, density = welch(samples, 1.0 / step, nperseg=min(_SEGMENT, samples.size))
            # Welch's method takes the mean away with the first lines; what is slower is as strong as the slowest it gives.
            power += samples.size * np.interp(frequency, known[1:], density[1:])
        colored = np.fft.irfft(np.sqrt(power) * np.fft.rfft(white), n_samples)
        return np.asarray(self.std * colored / np.std(colored))


@dataclass(frozen=True, eq=False)
class Competitor:
    """A model with the name it is compared under, and where it came from."""

    name: str
    model: Model
    source: str


@dataclass(frozen=True)
class Failure:
    """What could not be compared, and why; `column` is None where the model could not be simulated at all."""

    model: str
    record: str
    reason: str
    column: Column | None = None


@dataclass(frozen=True, eq=False)
class RecordComparison:
    """All models on one record."""

    record: Record  # the measured record
    measured: dict[str, FrequencyResponse]  # path -> measured frequency response
    # Model -> path -> response of its simulation.
    simulated: dict[str, dict[str, FrequencyResponse]] = field(default_factory=dict)
    step: StepWindow | None = None  # where a step is compared, None for other records
    # Output -> model -> samples inside the step window, offset removed, shape (n_inside,).
    moved: dict[str, dict[str, Floats]] = field(default_factory=dict)
    # What was found, and what was not.
    scores: tuple[Score, ...] = ()
    failures: tuple[Failure, ...] = ()
    notes: tuple[str, ...] = ()  # what is to be known about the record here


@dataclass(frozen=True, eq=False)
class Comparison:
    """Models x records.

    Attributes
    ----------
    title, rig
        Of the campaign.
    method
        Estimator of the frequency responses, measured and simulated.
    step_seconds
        Length of the step windows [s].
    window_length
        Length of the windows of free run [s], None where records are run as a whole.
    competitors
        The models in the order they were named.
    records
        One comparison per record, in the order of the campaign.
    floors
        Noise floor of each output.
    notes
        What is to be known about the whole.
    """

    title: str
    rig: str
    method: Method
    step_seconds: float
    window_length: float | None
    competitors: tuple[Competitor, ...]
    records: tuple[RecordComparison, ...]
    floors: tuple[Floor, ...]
    notes: tuple[str, ...] = ()

    @property
    def scores(self) -> tuple[Score, ...]:
        """All scores, record by record."""
        return tuple(score for record in self.records for score in record.scores)

    @property
    def failures(self) -> tuple[Failure, ...]:
        """All failures, record by record."""
        return tuple(failure for record in self.records for failure in record.failures)

    def columns(self, record: str | None = None) -> tuple[Column, ...]:
        """Return what was compared, path by path and output by output.

        Parameters
        ----------
        record
            Name of a record; None for all of them.
        """
        found = dict.fromkeys(s.column for s in self.scores if record is None or s.record == record)
        kinds = list(QUANTITIES)
        signals = list(dict.fromkeys(column.signal for column in found))
        is_path = {signal: " -> " in signal for signal in signals}
        return tuple(
            sorted(
                found, key=lambda c: (not is_path[c.signal], signals.index(c.signal), kinds.index(c.quantity))
            )
        )

    def table(self, record: str) -> dict[str, dict[Column, float]]:
        """Return model -> column -> error on one record; what could not be found is left out.

        Parameters
        ----------
        record
            Name of the record.
        """
        rows: dict[str, dict[Column, float]] = {c.name: {} for c in self.competitors}
        for score in self.scores:
            if score.record == record:
                rows[score.model][score.column] = score.value
        return rows

    def overall(self) -> dict[str, dict[Column, float]]:
        """Return model -> column -> root mean square of the error over all records that show it.

        A model that failed on one of these records has no entry: its mean over the others would flatter it.
        """
        shown = {column: {s.record for s in self.scores if s.column == column} for column in self.columns()}
        rows: dict[str, dict[Column, float]] = {}
        for competitor in self.competitors:
            own = [score for score in self.scores if score.model == competitor.name]
            rows[competitor.name] = {
                column: rms(np.array([s.value for s in own if s.column == column]))
                for column, records in shown.items()
                if {s.record for s in own if s.column == column} == records
            }
        return rows

    def floor(self, column: Column, record: str | None = None) -> float | None:
        """Return the noise floor of a column, in its unit; None if unknown.

        Parameters
        ----------
        column
            What was compared.
        record
            Name of a record; None for the root mean square over all that show the column.
        """
        known = {
            s.record: s.noise_floor
            for s in self.scores
            if s.column == column and (record is None or s.record == record)
        }
        values = [value for value in known.values() if value is not None]
        return rms(np.array(values)) if values and len(values) == len(known) else None


def best(rows: Mapping[str, Mapping[Column, float]], column: Column) -> frozenset[str]:
    """Return the models with the smallest error of a column; several where they tie."""
    values = {
        model: row[column] for model, row in rows.items() if column in row and math.isfinite(row[column])
    }
    if not values:
        return frozenset()
    smallest = min(values.values())
    return frozenset(model for model, value in values.items() if value <= smallest * (1.0 + _EQUAL))


def comparison_json(comparison: Comparison, figures: Mapping[str, str]) -> dict[str, Any]:
    """Return the content of ``comparison.json``."""
    overall = comparison.overall()
    content = {
        "schema_version": SCHEMA_VERSION,
        "title": comparison.title,
        "rig": comparison.rig,
        "method": comparison.method,
        "step_seconds": comparison.step_seconds,
        "window_length": comparison.window_length,
        "quantities": QUANTITIES,
        "models": [
            {"name": c.name, "source": c.source, "model": c.model.to_json()} for c in comparison.competitors
        ],
        "records": [
            {
                "name": r.record.name,
                "role": r.record.role,
                "kind": r.record.kind,
                "amplitude": r.record.amplitude,
                "notes": r.notes,
            }
            for r in comparison.records
        ],
        "noise_floors": [
            {key: getattr(floor, key) for key in ("output", "unit", "std", "method", "lower_bound")}
            for floor in comparison.floors
        ],
        "scores": [_score(s) for s in comparison.scores],
        "overall": [
            {
                "model": model,
                **_column(column),
                "value": row[column],
                "noise_floor": comparison.floor(column),
                "best": model in best(overall, column),
            }
            for model, row in overall.items()
            for column in row
        ],
        "failures": [
            {"model": f.model, "record": f.record, **_column(f.column), "reason": f.reason}
            for f in comparison.failures
        ],
        "notes": comparison.notes,
        "figures": figures,
    }
    return json_data(content)


def comparison_csv(comparison: Comparison) -> str:
    """Return the content of ``comparison.csv``: SI units, an empty value with its problem where a model failed."""
    file = io.StringIO()
    table = csv.writer(file, lineterminator="\n")
    table.writerow(_HEAD)
    for own in comparison.records:
        record = own.record
        facts = (record.name, record.role, record.kind, "" if record.amplitude is None else record.amplitude)
        rows = comparison.table(record.name)
        winners = {column: best(rows, column) for column in comparison.columns(record.name)}
        for s in own.scores:
            floor = "" if s.noise_floor is None else f"{s.noise_floor:.9g}"
            first = "yes" if s.model in winners[s.column] else "no"
            reported = (f"{s.value:.9g}", floor, s.n_values, first, "")
            table.writerow((s.model, *facts, s.column.signal, s.column.quantity, s.column.unit, *reported))
        for f in own.failures:
            missing = [f.column] if f.column else comparison.columns(record.name)
            for column in missing or (None,):
                named = ("", "", "") if column is None else (column.signal, column.quantity, column.unit)
                table.writerow((f.model, *facts, *named, "", "", "", "no", " ".join(f.reason.split())))
    return file.getvalue()


def _column(column: Column | None) -> dict[str, str]:
    keys = () if column is None else ("signal", "quantity", "unit")
    return {key: getattr(column, key) for key in keys}


def _score(score: Score) -> dict[str, Any]:
    facts = {key: value for key, value in vars(score).items() if key != "column"}
    return {"model": facts.pop("model"), "record": facts.pop("record"), **_column(score.column), **facts}
