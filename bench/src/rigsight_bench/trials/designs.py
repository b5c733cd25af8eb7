"""The designs (lists of trials), and the function that draws a trial of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal, get_args

from rigsight.errors import check_option
from rigsight_bench.trials.handwritten.cells import handwritten_cells
from rigsight_bench.trials.handwritten.trial import draw_handwritten_trial
from rigsight_bench.trials.laboratory.subjects import laboratory_cells
from rigsight_bench.trials.laboratory.trial import draw_laboratory_trial
from rigsight_bench.trials.standard.subjects import standard_cells
from rigsight_bench.trials.standard.trial import draw_standard_trial
from rigsight_bench.trials.trial import Trial

Design = Literal["standard", "laboratory", "handwritten"]
"""One on the running gear or an axis with effects as the catalogue declares them, one with records as laboratories take them, one
with plants whose equations are written by hand."""
_DESIGNS: dict[Design, tuple[Callable[[], Sequence[Any]], Callable[[int, int], Trial]]] = {
    "standard": (standard_cells, draw_standard_trial),
    "laboratory": (laboratory_cells, draw_laboratory_trial),
    "handwritten": (handwritten_cells, draw_handwritten_trial),
}


def n_trials(design: Design) -> int:
    """Return the number of trials of one pass.

    Raises
    ------
    InputError
        If there is no such design.
    """
    cells, _ = _DESIGNS[check_option("The design", design, get_args(Design))]  # type: ignore[index]
    return len(cells())


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
    _, draw = _DESIGNS[check_option("The design", design, get_args(Design))]  # type: ignore[index]
    return draw(seed, trial)
