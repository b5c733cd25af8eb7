"""Scoring of one diagnosed trial: its key is opened, and its model is simulated on the withheld records."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Place
from rigsight.errors import SimulationError
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records import Record
from rigsight.simulate import simulate
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.model_file import read_model
from rigsight.workflow.run.results import DIAGNOSIS_FILE
from rigsight_bench.running.execution import source_version
from rigsight_bench.running.files import RUN_FILE, BenchFolder, read_json
from rigsight_bench.scoring import Outcome, WithheldError, outcome, rig_of


def score_trial(folder: BenchFolder, name: str) -> Outcome:
    """Open the key of a diagnosed trial and compare the diagnosis with it.

    If the key gives no noise floor or gap, those of the diagnosis are used.

    Raises
    ------
    InputError
        If key, withheld records or results cannot be read.
    """
    key = folder.read_key(name)
    run = read_json(folder.result(name) / RUN_FILE)
    diagnosis, model = None, None
    if not run["message"]:
        diagnosis = read_json(folder.result(name) / DIAGNOSIS_FILE)
        model = read_model(folder.result(name))
        measured = {output: floor["std"] for output, floor in diagnosis["noise_floor"].items()}
        key["noise_floor"] = {**measured, **key["noise_floor"]}
        if key["gap"] is None:
            key["gap"] = _reidentified_gap(diagnosis)
    rig = rig_of(key)
    withheld = [
        WithheldError(
            name=record.name,
            kind=record.kind,
            amplitude=_amplitude(record, rig.inputs[0].name),
            n_samples=record.n_samples,
            error=None if model is None else _error(model, record, key["noise_floor"]),
        )
        for record in folder.withheld_records(name, rig)
    ]
    return outcome(
        {**key, "fingerprint": folder.fingerprint(name)},
        diagnosis,
        withheld,
        float(run["seconds"]),
        source_version(),
        str(run["message"]),
    )


def _reidentified_gap(diagnosis: Mapping[str, Any]) -> float | None:
    """Return the error of the re-identified equations on the scored records, in units of the diagnosis' noise floor."""
    ratios = [
        gap["reidentified"] / gap["noise_floor"]
        for gap in diagnosis["gap"].values()
        if gap and gap["reidentified"] is not None and gap["noise_floor"]
    ]
    return max(ratios, default=None)


def _amplitude(record: Record, driven: str) -> float:
    return float(np.max(np.abs(record[driven]))) if record.amplitude is None else record.amplitude


def _error(model: Model, record: Record, floor: Mapping[str, float]) -> float | None:
    """Return the RMS error of a model on a record in units of the noise floor; None where it cannot be simulated."""
    try:
        residuals = _residuals(model, record, floor)
    except SimulationError:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.concatenate([left / floor[name] for name, left in residuals.items()])
    error = math.sqrt(float(np.mean(relative**2)))
    return error if math.isfinite(error) else None


def _residuals(model: Model, record: Record, noise: Mapping[str, float]) -> dict[str, NDArray[np.float64]]:
    """Return measured minus predicted by output, from the input alone.

    The phase of an external disturbance follows from no input: if the model has one, the initial state is estimated.
    """
    names = [signal.name for signal in model.structure.rig.outputs if signal.name in record.signals]
    if not any(effect.place is Place.DISTURBANCE for effect in model.effects):
        simulated = simulate(model.structure, model.values, record)
        return {name: record[name] - simulated[name] for name in names}
    scales = characteristic_scales(model.structure.rig, [record], model.values)
    fit = GreyBoxFit(model.structure, [record], scales, noise).fit(model.values, [])
    if not fit.residuals:
        raise SimulationError(fit.message)
    return dict(zip(names, fit.residuals[0].T, strict=True))
