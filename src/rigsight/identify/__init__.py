"""Physical parameters from records: linear start values, grey-box fits, their uncertainty."""

from rigsight.identify.effect_start import EffectRegression as EffectRegression
from rigsight.identify.fit_result import FitResult as FitResult
from rigsight.identify.grey_box import GreyBoxFit as GreyBoxFit
from rigsight.identify.linear_start import linear_start as linear_start
from rigsight.identify.scales import characteristic_scales as characteristic_scales

__all__ = ["EffectRegression", "FitResult", "GreyBoxFit", "characteristic_scales", "linear_start"]
