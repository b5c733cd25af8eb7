"""Calibration of hysteresis to records, derived quantities, and features of frequency responses."""

from rigsight.identify.hysteresis.calibration import Calibration as Calibration
from rigsight.identify.hysteresis.calibration import Minimum as Minimum
from rigsight.identify.hysteresis.calibration import calibrate_to_records as calibrate_to_records
from rigsight.identify.hysteresis.derived import Derived as Derived
from rigsight.identify.hysteresis.derived import DerivedQuantities as DerivedQuantities
from rigsight.identify.hysteresis.derived import LoopArea as LoopArea
from rigsight.identify.hysteresis.derived import derived_quantities as derived_quantities
from rigsight.identify.hysteresis.derived import loop_area as loop_area
from rigsight.identify.hysteresis.features import Peak as Peak
from rigsight.identify.hysteresis.features import SpectralRatio as SpectralRatio
from rigsight.identify.hysteresis.features import break_frequency as break_frequency
from rigsight.identify.hysteresis.features import fitted_break_frequency as fitted_break_frequency
from rigsight.identify.hysteresis.features import peak as peak
