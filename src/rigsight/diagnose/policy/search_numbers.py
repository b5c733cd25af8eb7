"""How far is searched? Budgets and the order of work; a right model that they lose is lost, a wrong one does not gain."""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number


@dataclass(frozen=True)
class SearchNumbers:
    """How far is searched? Each field carries its reason."""

    predictability_draws: int = number(
        4,
        "budget",
        "Small disturbances that are simulated.",
    )
    wider_starts: tuple[float, ...] = number(
        (1.0 / 3.0, 1.0, 3.0),
        "budget",
        (
            "Factors on an effect's inner numbers beside its declared starts: a fit would move on from these, a "
            "push cannot."
        ),
    )
    few_starts: int = number(
        4,
        "budget",
        "Declared starts up to which the wider ones are tried: more of them span their range by themselves.",
    )
    fitted_pushes: int = number(
        2,
        "budget",
        "Pushes of each effect that are fitted, of all its starts.",
    )
    push_evaluations: int = number(
        6,
        "budget",
        "Evaluations of such a fit.",
    )
    push_substeps: int = number(
        4,
        "budget",
        "Integration steps per sample of a push.",
    )
    look_evaluations: int = number(
        25,
        "budget",
        "Evaluations of a first look.",
    )
    glimpse_evaluations: int = number(
        8,
        "budget",
        "Evaluations of a glimpse, before the best go on to a first look.",
    )
    most_starts: int = number(
        4,
        "budget",
        "Starts that are all fitted at length.",
    )
    lengthy_starts: int = number(
        2,
        "budget",
        "Of more starts, those that are fitted at length in pieces, best after a glimpse first.",
        set_by="hysteresis by sliders, five draws of noise: two to five of nine glimpses led to the best end",
    )
    wide_evaluations: int = number(
        12,
        "budget",
        "Evaluations of a look at whole records.",
    )
    near: float = number(
        25.0,
        "budget",
        (
            "A candidate whose cost in the liveliest stretches is below this factor of the best (five times its "
            "RMS) sees whole records."
        ),
    )
    alike_starts: float = number(
        1.05,
        "budget",
        "Starts whose first looks end within this factor of the best cost are all followed.",
    )
    most_restarts: int = number(
        4,
        "budget",
        "Times that a fit which stopped short is started again.",
    )
    worth_restarting: float = number(
        1e-3,
        "budget",
        "Share of the cost that a fit from elsewhere must remove to be followed.",
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
            "Mean squared error of whole records, in units of that of their liveliest stretches, at which a fit "
            "counts as stopped short."
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
        "Evaluations after which a candidate that is far off is dropped.",
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
        "The fewest that it gets.",
    )
    promising: float = number(
        9.0,
        "budget",
        (
            "A candidate that costs less than this factor of the best on whole records (three times its RMS) is "
            "followed to the end."
        ),
    )
    worth_following: float = number(
        0.85,
        "budget",
        "Factor by which an effect must lower the cost at a first look to be fitted beside another.",
    )
    most_followed: int = number(
        6,
        "budget",
        "Effects that are fitted beside another.",
    )
    near_the_best: float = number(
        2.0,
        "budget",
        "Models that cost at most this many times the best at a first look are fitted with care.",
    )
    both_ways: int = number(
        6,
        "budget",
        "Most promising pairs that are looked at from the fit of the second effect as well.",
    )
    joint_starts: int = number(
        18,
        "budget",
        "Starts of a pair of which no effect starts from a fit of its own, drawn where there are more.",
    )
    most_added_steps: int = number(
        4,
        "budget",
        "Integration steps of a first look beyond its parent's: enough for a lag of a fifth of a sample.",
    )
    beam: float = number(
        1.3,
        "budget",
        (
            "Singles are grown if their held-out error is within this factor of the best: the simplest, and the "
            "best that is unlike it."
        ),
    )
    alike_pairs: float = number(
        1.01,
        "budget",
        "Pairs within this factor of the best are fitted to the end as well.",
    )
    most_finished: int = number(
        2,
        "budget",
        "Pairs, and triples, that are fitted to the end.",
    )
    most_refitted: int = number(
        2,
        "budget",
        "Pairs whose parts are fitted alone again.",
    )
    most_swaps: int = number(
        2,
        "budget",
        "Times that a more general effect is put into the best pair: once for each of its two.",
    )
    finest_steps: int = number(
        4,
        "budget",
        (
            "Integration steps per sample up to which another parent than the plainest is grown from: each "
            "partner of a far stiffer loop would take as fine steps."
        ),
    )
    most_windowed_pairs: int = number(
        3,
        "budget",
        "Pairs that are fitted in windows: those nearest to the whole records.",
    )
    most_asked: int = number(
        4,
        "budget",
        "Models that are asked how predictable the motion is, and that are fitted in windows.",
        set_by="two drawn rigs with play",
    )
    smaller_starts: tuple[float, ...] = number(
        (1.0, 0.3),
        "budget",
        (
            "Factors on the declared starts of an effect in windows: too large a play sticks where a small one "
            "would not."
        ),
    )
    glimpsed_windows: int = number(
        3,
        "budget",
        "Every so many windows are read at a first glance.",
    )
    window_evaluations: int = number(
        10,
        "budget",
        "Evaluations of such a glance.",
    )
    window_starts: int = number(
        2,
        "budget",
        "Starts that are followed from there.",
    )
    line_neighbors: int = number(
        21,
        "budget",
        "Frequencies whose median is what a line stands out of.",
    )
    line_cycles: int = number(
        4,
        "convention",
        "Cycles in a record that tell a line from a drift.",
    )
    waves_per_line: float = number(
        4.0,
        "budget",
        "Wave numbers tried while one more wave comes to lie on the way; a fit finds back from half of one.",
    )
    most_waves: float = number(
        120.0,
        "budget",
        "Waves on the way up to which lines are looked for: more of them would take as long as the fits.",
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
            "Lines over which the spectrum is averaged that the others are weighed by: fewer would flatten what "
            "is looked for."
        ),
    )
    lowest_line: int = number(
        2,
        "convention",
        "First line of a spectrum over time that is used: below is drift, which initial states take.",
    )
    traced_samples: int = number(
        3000,
        "budget",
        (
            "Samples in which forces at joints are traced: they take about ten seconds of processor time per "
            "thousand on a drive train."
        ),
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
            "Nearest models that are also fitted from elsewhere; a farther one is named only if these "
            "are lost."
        ),
    )
    basin_starts: int = number(
        6,
        "budget",
        "Starts of each of them, drawn about its fit.",
    )
    basin_spread: float = number(
        0.3,
        "measured",
        "Standard deviation of the logarithms of an effect's numbers at these starts.",
        set_by="two rigs of the coverage study, seed 1: half of such starts led to the right basin",
    )
    basin_evaluations: int = number(
        15,
        "budget",
        "Evaluations from such a start.",
    )
    basin_finish_evaluations: int = number(
        60,
        "budget",
        "Evaluations of the fit in a lower basin.",
    )
