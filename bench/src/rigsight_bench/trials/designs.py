"""The designs (lists of trials), and the function that draws a trial of each."""

from __future__ import annotations

from typing import Literal, get_args

from rigsight.errors import check_option
from rigsight_bench.trials import draw, subjects
from rigsight_bench.trials.any_rig_subjects import placed_cells
from rigsight_bench.trials.any_rig_trial import draw_placed_trial
from rigsight_bench.trials.draw import Trial
from rigsight_bench.trials.handwritten.cells import handwritten_cells
from rigsight_bench.trials.handwritten.trial import draw_handwritten_trial
from rigsight_bench.trials.laboratory.subjects import laboratory_cells
from rigsight_bench.trials.laboratory.trial import draw_laboratory_trial

Design = Literal["small", "standard", "joints", "several", "rigs", "laboratory", "handwritten"]
"""Four on the running gear or an axis (`joints`: effects of servo and robot joints; `several`: two and three effects at once),
one at all places of every counted rig, one with records as laboratories take them, one with plants whose equations are written
by hand."""


def n_trials(design: Design) -> int:
    """Return the number of trials of one pass.

    Raises
    ------
    InputError
        If there is no such design.
    """
    check_option("The design", design, get_args(Design))
    if design == "rigs":
        return len(placed_cells())
    if design == "handwritten":
        return len(handwritten_cells())
    return len(laboratory_cells()) if design == "laboratory" else subjects.n_trials(design)


def draw_trial(design: Design, seed: int, trial: int) -> Trial:
    """Draw and measure one trial.

    Parameters
    ----------
    design
        List of cells to draw from.
    seed
        Seed of the whole bench.
    trial
        Number of the trial.

    Raises
    ------
    InputError
        If there is no such design.
    SimulationError
        If no rig that was drawn can be integrated and re-identified.
    """
    check_option("The design", design, get_args(Design))
    if design == "rigs":
        return draw_placed_trial(seed, trial)
    if design == "laboratory":
        return draw_laboratory_trial(seed, trial)
    if design == "handwritten":
        return draw_handwritten_trial(seed, trial)
    return draw.draw_trial(design, seed, trial)
