"""Budgets and order of the search. If they are too small, a right model may be missed, but a wrong one gains nothing."""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number
from rigsight.inverse import LAW_ERROR


@dataclass(frozen=True)
class SearchNumbers:
    """How far is searched? Each field carries its reason."""

    predictability_draws: int = number(
        4,
        "budget",
        "Number of small disturbances that are simulated.",
    )
    wider_starts: tuple[float, ...] = number(
        (1.0 / 3.0, 1.0, 3.0),
        "budget",
        (
            "Factors on the inner parameters of an effect, in addition to its declared starts: a fit could move away from its "
            "start, the screening by a fixed force cannot."
        ),
    )
    few_starts: int = number(
        4,
        "budget",
        "Largest number of declared starts for which the additional factors are tried: more starts cover the range by "
        "themselves.",
    )
    fitted_pushes: int = number(
        2,
        "budget",
        "Number of trial forces or signals of each effect, over all its starts, that are fitted.",
    )
    push_evaluations: int = number(
        6,
        "budget",
        "Evaluations of such a fit.",
    )
    push_substeps: int = number(
        4,
        "budget",
        "Integration steps per sample in the screening.",
    )
    look_evaluations: int = number(
        25,
        "budget",
        "Evaluations of a first fit.",
    )
    glimpse_evaluations: int = number(
        8,
        "budget",
        "Evaluations of a very short fit, from which the best go on to a first fit.",
    )
    most_starts: int = number(
        4,
        "budget",
        "Number of starts up to which all are fitted at length.",
    )
    lengthy_starts: int = number(
        2,
        "budget",
        "If there are more starts, number of those fitted at length in pieces, the best after the very short fit first.",
        set_by="hysteresis by sliders, five draws of noise: two to five of nine very short fits led to the best result",
    )
    wide_evaluations: int = number(
        12,
        "budget",
        "Evaluations of a first fit to whole records.",
    )
    near: float = number(
        25.0,
        "budget",
        (
            "A candidate whose cost in the most excited stretches is below this factor of the best (five times its RMS) is "
            "fitted to whole records."
        ),
    )
    alike_starts: float = number(
        1.05,
        "budget",
        "All starts whose first fits end within this factor of the best cost are continued.",
    )
    most_restarts: int = number(
        4,
        "budget",
        "Number of times that a fit which stopped too early is restarted.",
    )
    worth_restarting: float = number(
        1e-3,
        "budget",
        "Share of the cost that a fit from another start must remove to be continued.",
    )
    long_piece: float = number(
        20.0,
        "budget",
        "Length in periods of the pieces from which a stuck fit is started again.",
    )
    stuck: float = number(
        2.0,
        "budget",
        (
            "Mean squared error of whole records, in units of that of their most excited stretches, above which a fit counts as "
            "stopped too early."
        ),
    )
    rough_evaluations: int = number(
        40,
        "budget",
        "Evaluations of a rough fit to whole records.",
    )
    hopeless_evaluations: int = number(
        8,
        "budget",
        "Evaluations after which a candidate far behind the best is dropped.",
    )
    refine_evaluations: int = number(
        150,
        "budget",
        (
            "Evaluations of a careful fit with one integration step per sample; a model that takes more steps "
            "gets fewer."
        ),
    )
    fewest_refine_evaluations: int = number(
        15,
        "budget",
        "The minimum that it gets.",
    )
    promising: float = number(
        9.0,
        "budget",
        (
            "A candidate whose cost on whole records is below this factor of the best (three times its RMS) is fitted to "
            "convergence."
        ),
    )
    worth_following: float = number(
        0.85,
        "budget",
        "Factor by which an effect must lower the cost above that of noise at a first fit to be fitted together with another.",
    )
    most_followed: int = number(
        6,
        "budget",
        "Number of effects that are fitted together with another.",
    )
    near_the_best: float = number(
        2.0,
        "budget",
        "Models whose cost is at most this factor of the best at a first fit are fitted carefully.",
    )
    both_ways: int = number(
        6,
        "budget",
        "Number of the most promising pairs that are also tried from the fit of the second effect.",
    )
    joint_beam: int = number(
        200,
        "budget",
        "Number of pairs, in the screening of several effects together, that are extended to triples.",
    )
    joint_sets: int = number(
        6,
        "budget",
        "Number of pairs, and of triples, that are fitted because they explain most together in the screening.",
    )
    joint_starts: int = number(
        18,
        "budget",
        "Number of starts of a pair if neither effect starts from its own fit, drawn at random if there are more.",
    )
    most_added_steps: int = number(
        4,
        "budget",
        "Additional integration steps of a first fit relative to its parent: enough for a lag of a fifth of a sample.",
    )
    beam: float = number(
        1.3,
        "budget",
        (
            "A second effect is added to singles whose held-out error is within this factor of the best: to the simplest, and to "
            "the best that differs from it."
        ),
    )
    alike_pairs: float = number(
        1.01,
        "budget",
        "Pairs within this factor of the best are also fitted to convergence.",
    )
    most_finished: int = number(
        2,
        "budget",
        "Number of pairs, and of triples, that are fitted to convergence.",
    )
    most_refitted: int = number(
        2,
        "budget",
        "Number of pairs whose effects are fitted alone again.",
    )
    most_swaps: int = number(
        2,
        "budget",
        "Number of times that an effect of the best pair is replaced by a more general or similar one: once for each of the two.",
    )
    most_effects: int = number(
        3,
        "convention",
        "Number of effects up to which the search adds one at a time; sets that are selected along the motion may be larger.",
    )
    finest_steps: int = number(
        4,
        "budget",
        (
            "Integration steps per sample up to which a second effect is added to a model other than the simplest: pairs with a "
            "much stiffer model would need equally small steps."
        ),
    )
    most_windowed_pairs: int = number(
        3,
        "budget",
        "Number of pairs that are fitted in windows: those with the lowest error on the whole records.",
    )
    most_asked: int = number(
        4,
        "budget",
        "Number of models that are tested for sensitivity of the motion and fitted in windows.",
        set_by="two simulated random rigs with play",
    )
    smaller_starts: tuple[float, ...] = number(
        (1.0, 0.3),
        "budget",
        (
            "Factors on the declared starts of an effect in windows: a play that is too large stays stuck where a small one "
            "would not."
        ),
    )
    glimpsed_windows: int = number(
        3,
        "budget",
        "Only every n-th window is used in a very short fit.",
    )
    window_evaluations: int = number(
        10,
        "budget",
        "Evaluations of such a fit.",
    )
    window_starts: int = number(
        2,
        "budget",
        "Number of starts that are continued from there.",
    )
    waves_per_line: float = number(
        4.0,
        "budget",
        "Number of wave numbers tried per additional wave over the travel; a fit converges from half a wave away.",
    )
    most_waves: float = number(
        120.0,
        "budget",
        "Largest number of waves over the travel up to which lines are searched: more would take as long as the fits.",
    )
    most_wave_samples: int = number(
        16000,
        "budget",
        "Samples of all records together, for the same reason.",
    )
    wave_smoothing: int = number(
        15,
        "budget",
        (
            "Number of lines over which the reference spectrum for whitening is averaged: fewer would flatten the line that is "
            "searched."
        ),
    )
    lowest_line: int = number(
        2,
        "convention",
        "First line of a spectrum over time that is used: lower lines are drift, which initial states absorb.",
    )
    offset_evaluations: int = number(
        40,
        "budget",
        "Evaluations of a fit with an offset in each record.",
    )
    timing_evaluations: int = number(
        10,
        "budget",
        "Evaluations of a fit with another hold or shift.",
    )
    basin_models: int = number(
        3,
        "budget",
        (
            "Number of best models that are also fitted from other starts; a model further behind is named only if these drop "
            "out."
        ),
    )
    basin_starts: int = number(
        6,
        "budget",
        "Number of starts of each, drawn around its fit.",
    )
    basin_spread: float = number(
        0.3,
        "measured",
        "Standard deviation of the logarithms of the parameters of an effect at these starts.",
        set_by="two rigs of the coverage study, seed 1: half of such starts led to the right minimum",
    )
    basin_evaluations: int = number(
        15,
        "budget",
        "Evaluations from such a start.",
    )
    basin_finish_evaluations: int = number(
        60,
        "budget",
        "Evaluations of the fit in a lower minimum.",
    )
    decisive_force: float = number(
        0.25,
        "assumption",
        (
            "Share of the squared missing force along the measured motion that a family must explain alone for others to be left "
            "out of the fits."
        ),
        set_by="thirteen measured rigs: with 0.5 two rigs with friction (0.26, 0.37) were searched for all families",
    )
    near_force: float = number(
        0.5,
        "assumption",
        (
            "Share of that from which on another family, or another form beside other causes, may be the cause: terms of first "
            "order understate some."
        ),
    )
    noise_of_force: float = number(
        0.1,
        "convention",
        (
            "Share of the squared missing force along the motion that noise of the sensors may cause for the motion to rule out "
            "causes: one of a larger share shows."
        ),
    )
    law_error: float = number(
        LAW_ERROR,
        "assumption",
        (
            "Error of a law relative to its own force. Where the motion shows that laws err more than sensors, a residual of "
            "this part of the gap is that of the law that explains the rest."
        ),
        set_by="an assumption between two to ten percent of the reviews; the cubic spring leaves 4.1 % on silverbox",
    )
    most_unnamed: int = number(
        2,
        "budget",
        "Number of causes that the motion does not name, such as delays, that are added to those that it names.",
    )
