"""What is the frequency response of a record whose simulation begins anew in each window?

Each window has its own initial states, so no spectrum may reach over their ends. Every window is read by itself, with its own
transient, and the readings are averaged with the power of the source as weight: a sweep drives each line in few of them.
"""

from __future__ import annotations

import numpy as np

from rigsight.compare.response_error import SignalPath
from rigsight.diagnose.windows import cut
from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse
from rigsight.identify.transfer.record_response import Method, record_response
from rigsight.records import Record

_LEAST_CLEARNESS = 10.0
"""Power over variance (10 dB) from which a measured line is shown, as for records that are read whole."""


def windowed_response(
    record: Record, length: float, path: SignalPath, method: Method, *, clear: bool
) -> FrequencyResponse:
    """Return the response of one path, averaged over windows.

    Parameters
    ----------
    record
        The whole record; it is cut as the diagnosis cut it.
    length
        Of a window [s].
    path
        What is read.
    method
        Estimator.
    clear
        True keeps only lines that stand out of their noise.

    Raises
    ------
    InputError
        If the windows are too short for the estimator, or no line stands out.
    """
    windows = cut((record,), length)
    n_samples = min(window.n_samples for window in windows)
    line = 2.0 * np.pi / (n_samples * record.dt)
    weight, spread = np.zeros((2, n_samples // 2 + 1))
    total = np.zeros(n_samples // 2 + 1, dtype=np.complex128)
    read: FrequencyResponse | None = None
    problem = ""
    for whole in windows:
        # The same samples in each, so that all have the same lines.
        window = whole.slice(0, n_samples)
        hold = window.hold if path.is_commanded else "band_limited"
        try:
            found = record_response(
                window,
                path.source,
                path.response,
                path.order,
                method,
                hold=hold,
                least_clearness=0.0,
                with_coherence=False,
            ).response
        except InputError as error:
            problem = f" {error}"
            continue
        assert found.variance is not None
        at = np.rint(found.omega / line).astype(int)
        power = np.abs(np.fft.rfft(window[path.source] - np.mean(window[path.source]))[at]) ** 2
        weight[at] += power
        total[at] += power * found.values
        spread[at] += power**2 * found.variance
        read = found
    kept = np.flatnonzero(weight)
    if read is None or not kept.size:
        raise InputError(f"{path.name}: windows of {length:.3g} s show no frequency response.{problem}")
    response = FrequencyResponse(
        omega=np.asarray(line * kept, dtype=np.float64),
        values=total[kept] / weight[kept],
        source=path.source,
        response=path.response,
        unit=read.unit,
        variance=spread[kept] / weight[kept] ** 2,
        records=(record.name,),
        method=f"{read.method}, mean of {len(windows)} windows",
    ).band(0.0, path.upper_cut)
    if not clear:
        return response
    assert response.variance is not None
    return response.at(
        np.abs(response.values) ** 2 > _LEAST_CLEARNESS * response.variance, "out of their noise"
    )
