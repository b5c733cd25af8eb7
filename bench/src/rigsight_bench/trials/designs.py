"""The designs (lists of trials), and the function that draws a trial of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, get_args

from rigsight.errors import InputError, check_option
from rigsight_bench.trials.handwritten.cells import handwritten_cells
from rigsight_bench.trials.handwritten.trial import draw_handwritten_trial
from rigsight_bench.trials.laboratory.subjects import laboratory_cells
from rigsight_bench.trials.laboratory.trial import draw_laboratory_trial
from rigsight_bench.trials.measured.trial import draw_measured_trial, measured_cells
from rigsight_bench.trials.standard.subjects import standard_cells
from rigsight_bench.trials.standard.trial import draw_standard_trial
from rigsight_bench.trials.trial import Trial

Design = Literal["standard", "laboratory", "handwritten", "measured"]
"""One on the running gear or an axis with effects as the catalogue declares them, one with records as laboratories take them, one
with plants whose equations are written by hand, one with records of real rigs to which a known cause is added."""
MEASURED: Design = "measured"
"""The design that draws from a folder of campaigns."""
_DESIGNS: dict[Design, tuple[Callable[[], Sequence[Any]], Callable[[int, int], Trial]]] = {
    "standard": (standard_cells, draw_standard_trial),
    "laboratory": (laboratory_cells, draw_laboratory_trial),
    "handwritten": (handwritten_cells, draw_handwritten_trial),
}


def n_trials(design: Design, folder: Path | None = None) -> int:
    """Return the number of trials of one pass.

    Parameters
    ----------
    design
        List of cells to draw from.
    folder
        With the measured campaigns of design ``measured``, and of no other.

    Raises
    ------
    InputError
        If there is no such design, the folder is missing or one too many, or holds no campaign that can be used.
    """
    check_option("The design", design, get_args(Design))
    if _needs(design, folder):
        assert folder is not None
        return len(measured_cells(folder.resolve()))
    cells, _ = _DESIGNS[design]
    return len(cells())


def draw_trial(design: Design, seed: int, trial: int, folder: Path | None = None) -> Trial:
    """Draw and measure one trial.

    Parameters
    ----------
    design
        List of cells to draw from.
    seed
        Seed of the whole bench.
    trial
        Number of the trial.
    folder
        As for `n_trials`.

    Raises
    ------
    InputError
        If there is no such design, or as for `n_trials`.
    SimulationError
        If no rig that was drawn can be integrated and re-identified.
    """
    check_option("The design", design, get_args(Design))
    if _needs(design, folder):
        assert folder is not None
        return draw_measured_trial(folder.resolve(), seed, trial)
    _, draw = _DESIGNS[design]
    return draw(seed, trial)


def _needs(design: Design, folder: Path | None) -> bool:
    """Return True for the design of a folder; refuse a folder with another one, and its absence with this one."""
    if design == MEASURED and folder is None:
        raise InputError("Design measured adds causes to measured records: name the folder of the campaigns.")
    if design != MEASURED and folder is not None:
        raise InputError(f"Design {design} draws its rigs and reads no folder. Leave out {folder}.")
    return design == MEASURED
