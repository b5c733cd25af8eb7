"""Can the records be trusted, or would a fault of the data explain the gap before any effect does?"""

from __future__ import annotations

from collections.abc import Sequence

from rigsight.diagnose.amplitude_response import amplitude_dependence
from rigsight.diagnose.finding import DataQuality
from rigsight.diagnose.input_timing import input_timing
from rigsight.diagnose.sensor_faults import sensor_faults
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.records.record import Record


def data_quality(bench: Workbench, records: Sequence[Record], linear: Scored) -> DataQuality:
    """Look at the records before an effect is tried.

    Parameters
    ----------
    bench
        Records as they are fitted, scales and noise.
    records
        All records of the campaign, whole.
    linear
        The re-identified equations.

    Notes
    -----
    Where a strong effect hides it, a wrong hold shows only after that effect is in the model: `input_timing` can be asked again
    with the best model.
    """
    timing = input_timing(bench, (), linear.fit)
    return DataQuality(
        findings=(
            *(timing.findings() if timing is not None else ()),
            *(finding for record in records for finding in sensor_faults(bench.rig, record)),
        ),
        amplitude=amplitude_dependence(bench.rig, records),
    )
