"""Fit of a form whose order is too low for a response."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigsight.frequency import FrequencyResponse
from rigsight.identify.transfer.transfer_form import Order, TransferFit
from rigsight.identify.transfer.transfer_function import fit_frequency_response

_SHARES = tuple(float(share) for share in np.geomspace(0.01, 0.4, 7))


def fit_with_relative_error(
    response: FrequencyResponse, order: Order, magnitude_only: bool
) -> tuple[TransferFit, float]:
    """Return a fit and the relative error, the same for every line, with which the form explains the response.

    With the variances of the noise alone, the few most certain lines would dominate, wherever they are.
    """
    assert response.variance is not None
    for share in _SHARES:
        variance = response.variance + (share * response.magnitude) ** 2
        fit = fit_frequency_response(
            replace(response, variance=variance, noise_shares=None, noise_lines=None),
            order,
            magnitude_only=magnitude_only,
        )
        if fit.misfit <= 1.0:
            break
    return fit, share
