"""Physical parameters from records: transfer functions, linear start values, grey-box fits, their uncertainty."""

from rigsight.identify.conicity import ConicityEstimate as ConicityEstimate
from rigsight.identify.conicity import conicity_slope as conicity_slope
from rigsight.identify.conicity import creep_error_of_sine as creep_error_of_sine
from rigsight.identify.conicity import estimate_conicity as estimate_conicity
from rigsight.identify.driven_offsets import driven_offsets as driven_offsets
from rigsight.identify.effect_start import EffectRegression as EffectRegression
from rigsight.identify.fit_result import FitResult as FitResult
from rigsight.identify.grey_box import GreyBoxFit as GreyBoxFit
from rigsight.identify.joint import JointFit as JointFit
from rigsight.identify.joint import KindFit as KindFit
from rigsight.identify.joint import RecordResidual as RecordResidual
from rigsight.identify.joint import fit_jointly as fit_jointly
from rigsight.identify.linear_start import linear_start as linear_start
from rigsight.identify.physical import PhysicalEstimates as PhysicalEstimates
from rigsight.identify.physical import lateral_parameters as lateral_parameters
from rigsight.identify.physical import offsets as offsets
from rigsight.identify.physical import yaw_parameters as yaw_parameters
from rigsight.identify.scales import characteristic_scales as characteristic_scales
from rigsight.identify.transfer_fit import TransferFit as TransferFit
from rigsight.identify.transfer_form import TransferForm as TransferForm
from rigsight.identify.transfer_function import fit_frequency_response as fit_frequency_response
from rigsight.identify.transfer_step import fit_step as fit_step

__all__ = [
    "ConicityEstimate",
    "EffectRegression",
    "FitResult",
    "GreyBoxFit",
    "JointFit",
    "KindFit",
    "PhysicalEstimates",
    "RecordResidual",
    "TransferFit",
    "TransferForm",
    "characteristic_scales",
    "conicity_slope",
    "creep_error_of_sine",
    "driven_offsets",
    "estimate_conicity",
    "fit_frequency_response",
    "fit_jointly",
    "fit_step",
    "lateral_parameters",
    "linear_start",
    "offsets",
    "yaw_parameters",
]
