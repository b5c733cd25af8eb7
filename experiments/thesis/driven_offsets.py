"""Rest positions of a driven rig: offsets from the residuals of the fitted transfer functions of a sweep.

A sweep is not noise about its offset, and the mean of its current moves the rig: (2.26) and (2.27) of the thesis apply only after
the motion has been subtracted from the record.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from form_over_time import over_time
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.signal import lfilter

from rigsight.errors import InputError
from rigsight.identify import PhysicalEstimates
from rigsight.identify.fit.covariance import colored_covariance
from rigsight.identify.transfer.transfer_form import TransferFit
from rigsight.records.record import Hold, Record

_LEAST_SAMPLES = 20
_DIFFERENCE = 1e-4


def driven_offsets(
    record: Record, motion: TransferFit, lateral: TransferFit | None = None, name: str = "psi_off"
) -> PhysicalEstimates:
    """Return the offsets of a driven record: the constant parts that the motion of the fits does not explain.

    Small errors of the fits, and motion that decays from before the record, are separated from the offset. y is compared with
    the measured yaw angle, so a yaw motion that is not a PT2 does not affect y_off.

    Parameters
    ----------
    record
        Contains the sources and responses of the fits.
    motion
        Fit from the input to the motion (u to psi).
    lateral
        Fit from psi to y; None leaves y_off out.
    name
        Name of the motion's offset.

    Returns
    -------
    Offsets; their errors include the remaining colored noise, and motion that such transfer functions do not explain.

    Raises
    ------
    InputError
        If the record is too short.
    """
    if record.n_samples < _LEAST_SAMPLES:
        raise InputError(
            f"Record '{record.name}': {record.n_samples} samples are too few to find an offset; at least {_LEAST_SAMPLES} are "
            f"needed."
        )
    # psi is measured, so it has no content above the Nyquist frequency, whatever the hold of the current.
    parts: list[tuple[str, TransferFit, Hold]] = [(name, motion, record.hold)]
    if lateral is not None:
        parts.append(("y_off", lateral, "band_limited"))
    values: dict[str, float] = {}
    residuals, designs = [], []
    for own, fit, hold in parts:
        held = replace(record, hold=hold)
        found = np.array([fit.values[parameter] for parameter in fit.form.names])
        remainder = _unexplained(held, fit, found)
        design = np.column_stack(
            [np.ones(record.n_samples), _fading(fit, record.n_samples, record.dt), _errors(held, fit, found)]
        )
        solved = np.linalg.lstsq(design, remainder, rcond=None)[0]
        values[own] = float(solved[0])
        residuals.append(remainder - design @ solved)
        designs.append(design)
    places = np.cumsum([0, *(design.shape[1] for design in designs)])[:-1]
    stacked = block_diag(*designs)
    noise = colored_covariance(
        [(np.concatenate(residuals), stacked)], stacked.shape[1], [len(parts)], for_intervals=True
    )
    covariance = noise[np.ix_(places, places)]
    return PhysicalEstimates(
        tuple(values),
        values,
        covariance,
        f"(2.26), (2.27) from the residuals of the fits in record '{record.name}'",
    )


def _unexplained(record: Record, fit: TransferFit, found: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the response minus that of a form with these parameters to the source, shape (n_samples,)."""
    named = dict(zip(fit.form.names, found, strict=True))
    theta = fit.form.vector(named["omega_b"], named.get("zeta", 1.0), named.get("dead_time", 0.0))
    theta[0] = named["gain"]
    source = record[fit.source]
    moved = over_time(fit.form, source - source[0], record.dt, record.hold, theta)
    return np.asarray(record[fit.response] - named["gain"] * source[0] - moved)


def _fading(fit: TransferFit, n_samples: int, dt: float) -> NDArray[np.float64]:
    """Return signals that span the form's free motion, shape (n_samples, order)."""
    omega_b = fit.values["omega_b"]
    inertia = [] if fit.form.order == "pt1" else [omega_b**-2]
    poles = np.roots([*inertia, 2.0 * fit.values.get("zeta", 0.5) / omega_b, 1.0])
    pulse = np.zeros(n_samples)
    pulse[0] = 1.0
    first = lfilter([1.0], np.poly(np.exp(poles * dt)).real, pulse)
    shapes = [np.append(np.zeros(late), first[: n_samples - late]) for late in range(poles.size)]
    return np.asarray(np.column_stack(shapes) / np.max(np.abs(first)))


def _errors(record: Record, fit: TransferFit, found: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the residuals due to a small error of each parameter, shape (n_samples, n_parameters)."""
    columns = []
    for i, size in enumerate(found):
        step = np.zeros_like(found)
        step[i] = _DIFFERENCE * (record.dt if fit.form.names[i] == "dead_time" else abs(size))
        change = _unexplained(record, fit, found + step) - _unexplained(record, fit, found)
        columns.append(change / max(float(np.max(np.abs(change))), 1e-300))
    return np.column_stack(columns)
