"""Mass, damping and stiffness of an axis from a PT2."""

from __future__ import annotations

from rigsight.identify.transfer.running_gear_parameters import PhysicalEstimates, check_fit, motion_parameters
from rigsight.identify.transfer.transfer_fit import TransferFit
from rigsight.rigs import AXIS


def axis_parameters(fit: TransferFit, gain: float) -> PhysicalEstimates:
    """Return m, d and k of a PT2 from input to displacement, ``m x'' + d x' + k x = gain u``."""
    check_fit(fit, "pt2", "axis", "x / u")
    method = f"gain, break frequency and damping of the {fit.method}"
    return motion_parameters(AXIS, fit, {AXIS.motion.drive_gain.name: gain}, None, method)
