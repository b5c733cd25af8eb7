"""Blind trials: random rigs with hidden effects, simulated by a separate integrator and scored with a key."""

from rigsight.blind.designs import Design as Design
from rigsight.blind.designs import draw_trial as draw_trial
from rigsight.blind.designs import n_trials as n_trials
from rigsight.blind.draw import Trial as Trial
from rigsight.blind.outside import OUTSIDE as OUTSIDE
from rigsight.blind.plant import Plant as Plant
from rigsight.blind.scoring.parameter_errors import ParameterError as ParameterError
from rigsight.blind.scoring.score import Outcome as Outcome
from rigsight.blind.scoring.score import WithheldError as WithheldError
from rigsight.blind.scoring.score import outcome as outcome
from rigsight.blind.scoring.score import rig_of as rig_of
from rigsight.blind.scoring.summary import summary as summary
from rigsight.blind.subjects import subject_of as subject_of
