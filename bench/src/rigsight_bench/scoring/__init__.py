"""Scores of trials whose truth is known, single and summarized."""

from rigsight_bench.scoring.parameter_errors import ParameterError as ParameterError
from rigsight_bench.scoring.score import outcome as outcome
from rigsight_bench.scoring.score import rig_of as rig_of
from rigsight_bench.scoring.summary import summary as summary
from rigsight_bench.scoring.trial_outcome import Outcome as Outcome
from rigsight_bench.scoring.trial_outcome import WithheldError as WithheldError
