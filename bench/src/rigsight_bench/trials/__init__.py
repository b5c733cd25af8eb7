"""Blind trials: random rigs with hidden effects, and what a diagnosis is given of them."""

from rigsight_bench.trials.designs import Design as Design
from rigsight_bench.trials.designs import draw_trial as draw_trial
from rigsight_bench.trials.designs import n_trials as n_trials
from rigsight_bench.trials.standard.outside import OUTSIDE as OUTSIDE
from rigsight_bench.trials.standard.plant import Plant as Plant
from rigsight_bench.trials.trial import Trial as Trial
