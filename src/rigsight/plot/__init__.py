"""Figures that the report, the commands and notebooks share; every function returns a new figure."""

from typing import TYPE_CHECKING

from rigsight.plot.diagnosis import ForceLoop as ForceLoop
from rigsight.plot.diagnosis import comparison as comparison
from rigsight.plot.diagnosis import detail_window as detail_window
from rigsight.plot.diagnosis import force_loops as force_loops
from rigsight.plot.diagnosis import gap_budget as gap_budget
from rigsight.plot.diagnosis import ranking as ranking
from rigsight.plot.diagnosis import step_window as step_window
from rigsight.plot.drawing import display_scale as display_scale
from rigsight.plot.drawing import encoded as encoded
from rigsight.plot.drawing import envelope as envelope
from rigsight.plot.drawing import png_bytes as png_bytes
from rigsight.plot.drawing import style as style
from rigsight.plot.drawing import svg_text as svg_text
from rigsight.plot.drawing import with_unit as with_unit
from rigsight.plot.fitted_numbers import AmplitudePanel as AmplitudePanel
from rigsight.plot.fitted_numbers import AmplitudePoint as AmplitudePoint
from rigsight.plot.fitted_numbers import GroupPanel as GroupPanel
from rigsight.plot.fitted_numbers import amplitude_dependence as amplitude_dependence
from rigsight.plot.fitted_numbers import parameters_by_group as parameters_by_group
from rigsight.plot.frequency_responses import FittedCurve as FittedCurve
from rigsight.plot.frequency_responses import Panel as Panel
from rigsight.plot.frequency_responses import bode as bode
from rigsight.plot.frequency_responses import overlaid_responses as overlaid_responses
from rigsight.plot.frequency_responses import response_grid as response_grid
from rigsight.plot.gap_maps import gap_bars as gap_bars
from rigsight.plot.gap_maps import gap_states as gap_states
from rigsight.plot.gap_maps import gap_times as gap_times
from rigsight.plot.gap_maps import missing_force as missing_force
from rigsight.plot.model_comparison import ErrorPanel as ErrorPanel
from rigsight.plot.model_comparison import ResponsesPanel as ResponsesPanel
from rigsight.plot.model_comparison import StepPanel as StepPanel
from rigsight.plot.model_comparison import model_errors as model_errors
from rigsight.plot.model_comparison import model_responses as model_responses
from rigsight.plot.model_comparison import model_steps as model_steps
from rigsight.plot.model_comparison import model_styles as model_styles
from rigsight.plot.rig_picture import PlaceMark as PlaceMark
from rigsight.plot.rig_picture import rig_picture as rig_picture
from rigsight.plot.signals import channel_plots as channel_plots

if TYPE_CHECKING:
    # For packages that pass figures on and must not import matplotlib.
    from matplotlib.figure import Figure as Figure
