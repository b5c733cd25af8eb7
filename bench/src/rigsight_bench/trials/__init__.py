"""Blind trials: random rigs with hidden effects, simulated by a separate integrator."""

from rigsight_bench.trials.designs import Design as Design
from rigsight_bench.trials.designs import draw_trial as draw_trial
from rigsight_bench.trials.designs import n_trials as n_trials
from rigsight_bench.trials.draw import Trial as Trial
from rigsight_bench.trials.outside import OUTSIDE as OUTSIDE
from rigsight_bench.trials.plant import Plant as Plant
from rigsight_bench.trials.subjects import subject_of as subject_of
