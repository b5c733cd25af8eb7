"""Mass, damping and stiffness of an axis from a PT2, or from a PT1 of its velocity if it has no spring."""

from __future__ import annotations

import numpy as np

from rigsight.identify.fit.covariance import propagated_covariance
from rigsight.identify.transfer.running_gear_parameters import PhysicalEstimates, check_fit, motion_parameters
from rigsight.identify.transfer.transfer_fit import TransferFit
from rigsight.rigs import AXIS


def axis_parameters(fit: TransferFit, gain: float) -> PhysicalEstimates:
    """Return m, d and k of a PT2 from input to displacement, ``m x'' + d x' + k x = gain u``.

    Parameters
    ----------
    fit
        PT2 from u to x.
    gain
        Force per unit of input, positive.

    Raises
    ------
    InputError
        If the fit is not a PT2, or its gain is not positive.
    """
    check_fit(fit, "pt2", "axis", "x / u")
    method = f"gain, break frequency and damping of the {fit.method}"
    return motion_parameters(AXIS, fit, {AXIS.motion.drive_gain.name: gain}, None, method)


def springless_parameters(fit: TransferFit, gain: float) -> PhysicalEstimates:
    """Return m and d of a PT1 from input to velocity, ``m x'' + d x' = gain u``.

    Parameters
    ----------
    fit
        PT1 from u to x'.
    gain
        Force per unit of input, positive.
    """
    static, omega_b = fit.values["gain"], fit.values["omega_b"]
    d = gain / static
    m = d / omega_b
    chain = np.array([[-m / static, -m / omega_b], [-d / static, 0.0]])
    covariance = propagated_covariance(fit.covariance_of("gain", "omega_b"), chain)
    return PhysicalEstimates(
        ("m", "d"), {"m": m, "d": d}, covariance, f"gain and break frequency of the {fit.method}"
    )
