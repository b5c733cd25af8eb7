"""Input signals for experiments: sweeps, steps, stepped sines and multisines."""

from rigsight.excitation.multisines import Multisine as Multisine
from rigsight.excitation.multisines import crest_factor as crest_factor
from rigsight.excitation.multisines import multisine as multisine
from rigsight.excitation.multisines import multisine_lines as multisine_lines
from rigsight.excitation.sweeps import linear_sweep as linear_sweep
from rigsight.excitation.sweeps import log_sweep as log_sweep
from rigsight.excitation.sweeps import step as step
from rigsight.excitation.sweeps import stepped_sine as stepped_sine
from rigsight.excitation.sweeps import time_bandwidth_product as time_bandwidth_product
