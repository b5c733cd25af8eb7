"""What are the frequency responses of each record, measured and simulated, by one estimator?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast, get_args

import numpy as np
from numpy.typing import NDArray

from rigsight.compare.response_error import (
    SignalPath,
    measured_responses,
    response_error,
    signal_paths,
    simulated_response,
    without_shares,
)
from rigsight.diagnose.location.trace import Trace
from rigsight.diagnose.result import Diagnosis
from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse
from rigsight.identify.transfer.record_response import Method
from rigsight.records import Record
from rigsight.records.record import Hold, Kind
from rigsight.report.quantities import rig_of
from rigsight.report.wording import stage_names

_METHOD: Method = "local_rational"
_MOST_PATHS = 6
"""Paths of a rig with many inputs and sensors that a page shows per record."""
_FEWEST_LINES = 8
"""Lines below which there is no curve to look at."""


@dataclass(frozen=True, eq=False)
class PathResponse:
    """One signal path of one record."""

    path: str  # as in ``"u -> psi"``
    measured: FrequencyResponse  # at the lines that stand out of their noise
    # Stage of the diagnosis -> its response at lines of the measured one.
    simulated: Mapping[str, FrequencyResponse]
    decibel: Mapping[str, float]  # stage -> RMS of the ratio of the magnitudes, measured over simulated [dB]


def record_responses(diagnosis: Diagnosis, trace: Trace) -> tuple[PathResponse, ...]:
    """Return the responses of one record, path by path; none of a step, of an element, or where nothing stands out.

    Of a rig with several inputs and sensors they are those to each input beside the others; of very many those of the sensors
    with the largest gaps.

    There are none of a rig that drifts: what follows the measured motion has the measured response.
    """
    rig = rig_of(diagnosis)
    signals = {*trace.inputs, *trace.measured}
    if rig is None or not rig.is_driven or diagnosis.bandwidth is not None:
        return ()
    if rig.has_one_motion and not {rig.inputs[0].name, rig.outputs[0].name} <= signals:
        return ()
    paths = signal_paths(rig) if rig.has_one_motion else _worst(diagnosis, signal_paths(rig))
    found = []
    measured = _measured(diagnosis, trace, paths)
    stages = stage_names(diagnosis)
    for path in paths:
        own = measured.get(path.name)
        if own is None or own.omega.size < _FEWEST_LINES:
            continue
        simulated: dict[str, FrequencyResponse] = {}
        decibel: dict[str, float] = {}
        for stage in stages:
            outputs: Mapping[str, NDArray[np.float64]] = getattr(trace, stage)
            try:
                response = _simulated(diagnosis, trace, outputs, path, own)
                decibel[stage] = response_error(own, response).decibel
            except InputError:
                # A simulation that left the numbers, or does not move: the other stages are still worth seeing.
                continue
            simulated[stage] = without_shares(response)
        found.append(PathResponse(path.name, without_shares(own), simulated, decibel))
    return tuple(found)


def _worst(diagnosis: Diagnosis, paths: Sequence[SignalPath]) -> tuple[SignalPath, ...]:
    """Return as many paths as a page can show, those to the sensors with the largest gaps, in their order."""
    gaps = {output: float(np.nan_to_num(gap.reidentified)) for output, gap in diagnosis.gap.items()}
    ranked = sorted(paths, key=lambda path: -gaps.get(path.response, 0.0))[:_MOST_PATHS]
    return tuple(path for path in paths if path in ranked)


def _measured(
    diagnosis: Diagnosis, trace: Trace, paths: tuple[SignalPath, ...]
) -> Mapping[str, FrequencyResponse]:
    record = _record(diagnosis, trace, trace.measured)
    return measured_responses(record, paths, _METHOD)[0]


def _simulated(
    diagnosis: Diagnosis,
    trace: Trace,
    outputs: Mapping[str, NDArray[np.float64]],
    path: SignalPath,
    measured: FrequencyResponse,
) -> FrequencyResponse:
    record = _record(diagnosis, trace, outputs)
    return simulated_response(record, path, _METHOD, measured)


def _record(diagnosis: Diagnosis, trace: Trace, outputs: Mapping[str, NDArray[np.float64]]) -> Record:
    hold = diagnosis.model.get("hold")
    return Record(
        name=trace.record,
        dt=trace.dt,
        signals={**trace.inputs, **outputs},
        units=diagnosis.units,
        kind=cast("Kind", trace.kind),
        hold=cast("Hold", hold) if hold in get_args(Hold) else "foh",
    )
