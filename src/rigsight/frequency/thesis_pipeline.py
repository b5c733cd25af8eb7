"""Frequency response of a sweep as in the thesis; kept to reproduce its figures, not for identification.

References
----------
The thesis, sections 4.2 and 4.3: FFT of the response over FFT of the source, cut, ``unwrap``, phase "adjusted".
"""

from __future__ import annotations

import numpy as np

from rigsight.errors import InputError
from rigsight.frequency.frequency_response import FrequencyResponse
from rigsight.frequency.signal_pair import line_frequencies, pair_unit
from rigsight.records.record import Record

_ENDS = 15
"""Points at either end whose mean phase the thesis takes as the phase reached there."""


def thesis_response(
    record: Record,
    source: str,
    response: str,
    phase_drop: float,
    upper_cut: float,
    lower_cut: float = 0.0,
) -> FrequencyResponse:
    """Return the frequency response as the thesis computes it.

    Parameters
    ----------
    record
        A sweep.
    source, response
        Names of the signals.
    phase_drop
        Assumed phase loss of the response over the band [rad]: pi for a PT2, pi / 2 for a PT1.
    upper_cut, lower_cut
        Frequencies beyond which the spectra are cut [rad/s]; the thesis keeps ``u -> psi`` up to 80 and ``psi -> y`` up to
        30 rad/s.

    Raises
    ------
    InputError
        If fewer than 30 points are left, a line of the source is zero, or the phase does not fall.

    Notes
    -----
    The unwrapped phase is multiplied by ``phase_drop`` over the difference of the means of its first and last 15 points and
    shifted to begin at zero. This hides any other phase change (a delay, a lag, a wrap due to noise). The magnitude is the
    plain ratio. There is no variance.
    """
    omega = line_frequencies(record.n_samples, record.dt)
    spectra = {name: np.fft.rfft(record[name])[1 : omega.size + 1] for name in (source, response)}
    kept = (omega >= lower_cut) & (omega <= upper_cut)
    if np.count_nonzero(kept) < 2 * _ENDS:
        raise InputError(
            f"Record '{record.name}': {np.count_nonzero(kept)} frequencies lie between the cuts {lower_cut:g} and "
            f"{upper_cut:g} rad/s, and the thesis's phase needs {2 * _ENDS}: widen the cuts or record longer."
        )
    below = spectra[source][kept]
    if (np.abs(below) == 0.0).any():
        raise InputError(
            f"Record '{record.name}': the source '{source}' has no content at some frequency between the cuts."
        )
    ratio = spectra[response][kept] / below
    phase = np.unwrap(np.angle(ratio))
    fallen = float(np.mean(phase[:_ENDS]) - np.mean(phase[-_ENDS:]))
    if fallen <= 0.0:
        raise InputError(
            f"Record '{record.name}': the unwrapped phase of '{source}' -> '{response}' rises by {-fallen:.3g} rad between "
            "the cuts, so the rescaling of the thesis would invert it: reduce the upper cut, or use another estimator."
        )
    phase = phase * (phase_drop / fallen)
    phase -= phase[0]
    return FrequencyResponse(
        omega=omega[kept],
        values=np.abs(ratio) * np.exp(1j * phase),
        source=source,
        response=response,
        unit=pair_unit(record, source, response),
        records=(record.name,),
        method="thesis: FFT ratio, phase rescaled",
    )
