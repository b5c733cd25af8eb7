"""Physical parameters from records: transfer functions, linear start values, grey-box fits, their uncertainty."""

from rigsight.identify.fit.coordinates import Coordinates as Coordinates
from rigsight.identify.fit.covariance import SMOOTHED as SMOOTHED
from rigsight.identify.fit.covariance import sandwich_covariance as sandwich_covariance
from rigsight.identify.fit.covariance import spectral_product as spectral_product
from rigsight.identify.fit.fit_result import FitMemory as FitMemory
from rigsight.identify.fit.fit_result import FitResult as FitResult
from rigsight.identify.fit.grey_box import DEFAULT_ACCURACY as DEFAULT_ACCURACY
from rigsight.identify.fit.grey_box import GreyBoxFit as GreyBoxFit
from rigsight.identify.fit.idle_threads import IdleThreads as IdleThreads
from rigsight.identify.fit.record_derivatives import Derivatives as Derivatives
from rigsight.identify.fit.record_derivatives import RecordDerivatives as RecordDerivatives
from rigsight.identify.fit.record_derivatives import derivatives as derivatives
from rigsight.identify.fit.record_derivatives import own_derivatives as own_derivatives
from rigsight.identify.free_motion import OpenFactor as OpenFactor
from rigsight.identify.free_motion import open_factor as open_factor
from rigsight.identify.hysteresis import Calibration as Calibration
from rigsight.identify.hysteresis import DerivedQuantities as DerivedQuantities
from rigsight.identify.hysteresis import LoopArea as LoopArea
from rigsight.identify.hysteresis import SpectralRatio as SpectralRatio
from rigsight.identify.hysteresis import calibrate_to_records as calibrate_to_records
from rigsight.identify.hysteresis import derived_quantities as derived_quantities
from rigsight.identify.hysteresis import loop_area as loop_area
from rigsight.identify.information import answers_to_states as answers_to_states
from rigsight.identify.joint import JointFit as JointFit
from rigsight.identify.joint import KindFit as KindFit
from rigsight.identify.joint import RecordResidual as RecordResidual
from rigsight.identify.joint import fit_jointly as fit_jointly
from rigsight.identify.one_step import OneStep as OneStep
from rigsight.identify.record_offsets import OFFSETS_MEND as OFFSETS_MEND
from rigsight.identify.record_offsets import DifferingMeans as DifferingMeans
from rigsight.identify.record_offsets import differing_means as differing_means
from rigsight.identify.record_offsets import swallowed_by_offsets as swallowed_by_offsets
from rigsight.identify.record_offsets import without_offsets as without_offsets
from rigsight.identify.start.effect_start import EffectRegression as EffectRegression
from rigsight.identify.start.linear_start import linear_start as linear_start
from rigsight.identify.start.off_bounds import off_bounds as off_bounds
from rigsight.identify.start.scales import characteristic_scales as characteristic_scales
from rigsight.identify.transfer.conicity import ConicityEstimate as ConicityEstimate
from rigsight.identify.transfer.conicity import creep_error_of_sine as creep_error_of_sine
from rigsight.identify.transfer.conicity import estimate_conicity as estimate_conicity
from rigsight.identify.transfer.driven_offsets import driven_offsets as driven_offsets
from rigsight.identify.transfer.running_gear_parameters import PhysicalEstimates as PhysicalEstimates
from rigsight.identify.transfer.running_gear_parameters import lateral_parameters as lateral_parameters
from rigsight.identify.transfer.running_gear_parameters import offsets as offsets
from rigsight.identify.transfer.running_gear_parameters import yaw_parameters as yaw_parameters
from rigsight.identify.transfer.transfer_fit import TransferFit as TransferFit
from rigsight.identify.transfer.transfer_form import TransferForm as TransferForm
from rigsight.identify.transfer.transfer_function import fit_frequency_response as fit_frequency_response
from rigsight.identify.transfer.transfer_step import fit_step as fit_step

__all__ = [
    "DEFAULT_ACCURACY",
    "OFFSETS_MEND",
    "SMOOTHED",
    "Calibration",
    "ConicityEstimate",
    "Coordinates",
    "Derivatives",
    "DerivedQuantities",
    "DifferingMeans",
    "EffectRegression",
    "FitMemory",
    "FitResult",
    "GreyBoxFit",
    "IdleThreads",
    "JointFit",
    "KindFit",
    "LoopArea",
    "OneStep",
    "OpenFactor",
    "PhysicalEstimates",
    "RecordDerivatives",
    "RecordResidual",
    "SpectralRatio",
    "TransferFit",
    "TransferForm",
    "answers_to_states",
    "calibrate_to_records",
    "characteristic_scales",
    "creep_error_of_sine",
    "derivatives",
    "derived_quantities",
    "differing_means",
    "driven_offsets",
    "estimate_conicity",
    "fit_frequency_response",
    "fit_jointly",
    "fit_step",
    "lateral_parameters",
    "linear_start",
    "loop_area",
    "off_bounds",
    "offsets",
    "open_factor",
    "own_derivatives",
    "sandwich_covariance",
    "spectral_product",
    "swallowed_by_offsets",
    "without_offsets",
    "yaw_parameters",
]
