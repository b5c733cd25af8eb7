"""Over which stretch is a model compared with records, and how far is searched?

If budgets are too small, a right model may be missed, but a wrong one gains nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import assumption, budget, convention, measured
from rigsight.inverse import LAW_ERROR


@dataclass(frozen=True)
class HorizonNumbers:
    """Over which stretch is a model compared with records?"""

    observer_close: float = assumption(
        6.0,
        "Bandwidth of the fastest observer, in units of the typical frequency of the velocity: low enough that the harmonics of "
        "friction remain visible.",
    )
    observer_loose: float = assumption(
        0.1, "The same for the slowest observer: errors accumulate over ten periods."
    )
    observer_holds: float = assumption(
        2.0,
        "Bandwidth of the slowest observer of an unstable mass, in units of its fastest pole: from the pole itself on it is "
        "stable, and from 1.4 times the pole on also with negative damping.",
    )
    observer_step: float = budget(2.0, "Ratio of the bandwidths of successive observers.")
    observer_sampling: float = convention(
        0.2,
        "Largest product of bandwidth and sample time: a faster observer follows the noise of single samples.",
    )
    clear_gap: float = convention(
        10.0, "Gap, in units of the noise floor, that is large enough to show its cause."
    )
    piece: float = assumption(
        4.0,
        "Length of a piece with its own initial state, in periods of the rig: an inaccurate model stays in phase with the "
        "motion for about this long.",
        "simulated random rigs with play of several widths: pieces of half to two periods were worse",
    )
    examined: int = budget(
        8000,
        "Number of samples, of all records together, to which candidates are first fitted: fits to whole records of 40 s take "
        "four times as long.",
    )
    most_pieces: int = budget(
        40,
        "Largest number of pieces of all records per degree of freedom: every piece adds its own initial state.",
    )
    rough_evaluations_of_rig: int = budget(
        8, "Evaluations of the rig's equations from each other set of start values."
    )
    lost: float = assumption(
        3.0,
        "RMS error of the given simulation, in standard deviations of a reading, from which on several bodies are not run free. "
        "Two motions of one size in opposite phase differ by two.",
        "an arm whose free run ends ten deviations off",
    )


@dataclass(frozen=True)
class SearchNumbers:
    """How far is searched?"""

    predictability_draws: int = budget(4, "Number of small disturbances that are simulated.")
    wider_starts: tuple[float, ...] = budget(
        (1.0 / 3.0, 1.0, 3.0),
        "Factors on the inner parameters of an effect, in addition to its declared starts: a fit could move away from its "
        "start, the screening by a fixed force cannot.",
    )
    few_starts: int = budget(
        4,
        "Largest number of declared starts for which the additional factors are tried: more starts cover the range by "
        "themselves.",
    )
    fitted_pushes: int = budget(
        2, "Number of trial forces or signals of each effect, over all its starts, that are fitted."
    )
    push_evaluations: int = budget(6, "Evaluations of such a fit.")
    push_substeps: int = budget(4, "Integration steps per sample in the screening.")
    look_evaluations: int = budget(25, "Evaluations of a first fit.")
    glimpse_evaluations: int = budget(
        8, "Evaluations of a very short fit, from which the best go on to a first fit."
    )
    most_starts: int = budget(4, "Number of starts up to which all are fitted at length.")
    lengthy_starts: int = budget(
        2,
        "If there are more starts, number of those fitted at length in pieces, the best after the very short fit first.",
        "hysteresis by sliders, five draws of noise: two to five of nine very short fits led to the best result",
    )
    larger_gain: float = assumption(
        10.0,
        "Factor of the gain of a drive in a further start beside a limit: a fit without the limit takes what it cuts off for "
        "a small gain.",
        "a position servo in its limit most of the time: factors of 10 and 30 lead to the best fit, 1 and 100 mostly not",
    )
    wide_evaluations: int = budget(12, "Evaluations of a first fit to whole records.")
    near: float = budget(
        25.0,
        "A candidate whose cost in the most excited stretches is below this factor of the best (five times its RMS) is fitted "
        "to whole records; so is one to all windows if a very short fit of some is below this factor of the floor.",
    )
    alike_starts: float = budget(
        1.05, "All starts whose first fits end within this factor of the best cost are continued."
    )
    most_restarts: int = budget(4, "Number of times that a fit which stopped too early is restarted.")
    worth_restarting: float = budget(
        1e-3, "Share of the cost that a fit from another start must remove to be continued."
    )
    long_piece: float = budget(
        20.0, "Length in periods of the pieces from which a stuck fit is started again."
    )
    stuck: float = budget(
        2.0,
        "Mean squared error of whole records, in units of that of their most excited stretches, above which a fit counts as "
        "stopped too early.",
    )
    rough_evaluations: int = budget(40, "Evaluations of a rough fit to whole records.")
    hopeless_evaluations: int = budget(
        8, "Evaluations after which a candidate far behind the best is dropped."
    )
    refine_evaluations: int = budget(
        150,
        "Evaluations of a careful fit with one integration step per sample; a model that takes more steps gets fewer.",
    )
    fewest_refine_evaluations: int = budget(15, "The minimum that it gets.")
    promising: float = budget(
        9.0,
        "A candidate whose cost on whole records is below this factor of the best (three times its RMS) is fitted to "
        "convergence.",
    )
    worth_following: float = budget(
        0.85,
        "Factor by which an effect must lower the cost above that of noise at a first fit to be fitted together with another.",
    )
    most_followed: int = budget(6, "Number of effects that are fitted together with another.")
    near_the_best: float = budget(
        2.0,
        "Models whose cost is at most this factor of the best at a first fit are fitted carefully, and sets of causes whose cost "
        "is at most this factor of that without them.",
    )
    both_ways: int = budget(
        6, "Number of the most promising pairs that are also tried from the fit of the second effect."
    )
    joint_beam: int = budget(
        200, "Number of pairs, in the screening of several effects together, that are extended to triples."
    )
    joint_sets: int = budget(
        6,
        "Number of pairs, and of triples, that are fitted because they explain most together in the screening.",
    )
    most_added_steps: int = budget(
        4,
        "Additional integration steps of a first fit relative to its parent: enough for a lag of a fifth of a sample.",
    )
    alike_pairs: float = budget(
        1.01, "Factor within which the errors of a single effect and of a pair count as equal."
    )
    most_refitted: int = budget(2, "Number of pairs whose effects are fitted alone again.")
    most_effects: int = convention(
        3,
        "Number of effects of a model beside which an even effect is no longer tried in the place of a constant force.",
    )
    most_windowed_pairs: int = budget(
        3, "Number of pairs that are fitted in windows: those with the lowest error on the whole records."
    )
    most_asked: int = budget(
        4,
        "Number of models that are tested for sensitivity of the motion and fitted in windows.",
        "two simulated random rigs with play",
    )
    smaller_starts: tuple[float, ...] = budget(
        (1.0, 0.3),
        "Factors on the declared starts of an effect in windows: a play that is too large stays stuck where a small one would "
        "not.",
    )
    glimpsed_windows: int = budget(3, "Only every n-th window is used in a very short fit.")
    window_evaluations: int = budget(10, "Evaluations of such a fit.")
    window_starts: int = budget(2, "Number of starts that are continued from there.")
    waves_per_line: float = budget(
        4.0,
        "Number of wave numbers tried per additional wave over the travel; a fit converges from half a wave away.",
    )
    most_waves: float = budget(
        120.0,
        "Largest number of waves over the travel up to which lines are searched: more would take as long as the fits.",
    )
    most_wave_samples: int = budget(16000, "Samples of all records together, for the same reason.")
    wave_smoothing: int = budget(
        15,
        "Number of lines over which the reference spectrum for whitening is averaged: fewer would flatten the line that is "
        "searched.",
    )
    lowest_line: int = convention(
        2,
        "First line of a spectrum over time that is used: lower lines are drift, which initial states absorb.",
    )
    offset_evaluations: int = budget(40, "Evaluations of a fit with an offset in each record.")
    timing_evaluations: int = budget(10, "Evaluations of a fit with another hold or shift.")
    basin_models: int = budget(
        3,
        "Number of best models that are also fitted from other starts; a model further behind is named only if these drop out.",
    )
    basin_starts: int = budget(6, "Number of starts of each, drawn around its fit.")
    basin_spread: float = measured(
        0.3,
        "Standard deviation of the logarithms of the parameters of an effect at these starts.",
        "two rigs of the coverage study, seed 1: half of such starts led to the right minimum",
    )
    basin_evaluations: int = budget(15, "Evaluations from such a start.")
    basin_finish_evaluations: int = budget(60, "Evaluations of the fit in a lower minimum.")
    decisive_force: float = assumption(
        0.25,
        "Share of the squared missing force along the measured motion that a family must explain alone, by the lower limit of "
        "its interval, for others to be left out of the fits.",
        "thirteen measured rigs: with 0.5 two rigs with friction (0.26, 0.37) were searched for all families",
    )
    near_force: float = assumption(
        0.5,
        "Share of that from which on another family, or another form beside other causes, may be the cause: terms of first "
        "order understate some.",
    )
    noise_of_force: float = convention(
        0.1,
        "Share of the squared missing force along the motion that noise of the sensors may cause for the motion to rule out "
        "causes: one of a larger share shows.",
    )
    law_error: float = assumption(
        LAW_ERROR,
        "Error of a law relative to its own force. Where the motion shows that laws err more than sensors, a residual of this "
        "part of the gap is that of the law that explains the rest.",
        "an assumption between two to ten percent of the reviews; the cubic spring leaves 4.1 % on silverbox",
    )
    most_unnamed: int = budget(
        2,
        "Number of causes that are added to those that the motion names, such as delays, or to a single one.",
    )
