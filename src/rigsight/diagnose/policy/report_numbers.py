"""How finely is the gap mapped, when is a number the same everywhere, and how often is it drawn?"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import budget, convention, measured


@dataclass(frozen=True)
class MapNumbers:
    """With which resolution is the gap mapped?"""

    bands: int = convention(8, "Bands of frequency into which the gap is split.")
    segments: int = convention(8, "Number of segments of a record whose spectra are averaged.")
    fewest_band_samples: int = convention(64, "Minimum samples of a segment.")
    beyond_the_input: float = convention(
        1e-2, "Share of the input's power that may lie on either side of the excited range."
    )
    beyond_the_answer: float = convention(
        1e-3,
        "Share of the response power that may lie above this range: after a step the rig rings at frequencies where the input "
        "has little power.",
    )
    stands_out: float = convention(
        4.0, "Ratio of response power to noise power at which a frequency counts as responding."
    )
    rests: float = convention(1e-3, "Relative deviation within which a signal counts as constant.")
    cells: int = convention(9, "Cells along each axis of the state plane.")
    cutoff_margin: float = convention(
        1.5, "Cutoff of the smoothing of motions, in units of the highest responding frequency."
    )
    highest_cutoff: float = convention(0.8, "Upper limit of this cutoff, in units of the Nyquist frequency.")
    filter_order: int = convention(4, "Order of that filter.")
    time_stretches: int = convention(24, "Stretches of time into which a record is cut.")
    fewest_stretch_samples: int = convention(20, "Minimum samples of such a stretch.")
    least_noise: int = convention(250, "Minimum samples of pure noise for an estimate of its spectrum.")
    mapped_samples: int = budget(
        8000,
        "Maximum samples for which the motion of joints is reconstructed: about a second of processor time per thousand on a "
        "drive train.",
    )
    slowest_rate: float = convention(
        1e-3,
        "Slowest rate searched on the lateral section, in units of the inverse length of the longest record.",
    )
    fastest_rate: float = convention(1.0, "Fastest rate, in units of the inverse sample time.")
    largest_shift: float = convention(0.05, "Largest shift, in units of the longest record.")
    limits: tuple[float, ...] = convention((0.025, 0.975), "Quantiles of the intervals of the gap budget.")


@dataclass(frozen=True)
class TrustNumbers:
    """What is a number asked before it is called the same everywhere?"""

    level: float = convention(
        0.01,
        "Probability that any parameter of a correct model is reported as differing, over all tests (Holm). It equals the level "
        "of the adequacy test, so that the two contradict each other no more often than that.",
    )
    in_order: float = convention(
        0.9,
        "Share of the squared differences that a monotonic trend must explain if the rest is significant: no effect is exactly "
        "monotonic, and with small errors the smallest deviation is significant.",
    )
    fewest_in_time: int = convention(
        3, "Minimum number of records for a trend over time: two always rise or fall."
    )
    one_level: float = convention(
        1.1,
        "Ratio up to which measured amplitudes count as one level: repeats differ by a few percent, steps between levels are "
        "larger.",
    )
    windows: tuple[int, int] = convention(
        (2, 4), "Windows into which each record is cut: halves and quarters."
    )
    window_samples: int = convention(
        100,
        "Minimum samples of the shortest window: in fewer, its own initial state uses up most of the information; the same as "
        "for other windows.",
    )
    window_periods: float = convention(
        2.0,
        "Natural periods of the shortest window: damping and stiffness need at least one full oscillation.",
    )
    periods_alone: float = measured(
        15.0,
        "Minimum natural periods of a window that is compared with others of its record: in fewer, a resonance is only one "
        "spectral line wide, so the effect of a disturbance there is a single random draw.",
        "axis with a damping ratio of 0.08 and a disturbing force of up to 80 noises: with quarters of 9.5 periods 3 of 30 "
        "right models were said to differ along the record, with halves of 19 one of 80",
    )
    worth_a_step: float = convention(
        0.05,
        "Reduction of a record's squared error by its own parameters above which they are refined beyond one linearization: "
        "with correct common parameters, ten parameters explain a hundredth of a thousand samples of noise.",
    )
    own_steps: int = budget(5, "Gauss-Newton steps for a record that needs other parameters.")
    state_evaluations: int = budget(
        15, "Evaluations in which the initial states of windows are fitted at the parameters of their record."
    )
    unsure: float = convention(
        30.0,
        "A value whose error exceeds that of the best group by this factor is left out: its weight would be a thousandth.",
    )
    least_freedom: float = convention(
        2.0,
        "Degrees of freedom of the noise that remain after a fit in the narrowest band: those of one spectral line.",
    )
    correlated: float = convention(
        0.99,
        "Correlation above which two parameters are reported as hardly separable: the standard error of each would be seven "
        "times smaller if the other were known.",
    )
    one_to_one: float = convention(
        0.2,
        "Relative difference up to which the errors of two parameters count as those of a ratio or product.",
    )
    vague: float = convention(
        0.1,
        "Relative error per group above which agreement means little: an engineer regards a difference of a tenth as a "
        "different value.",
    )
    may_be_zero: float = convention(
        3.0, "Standard errors from zero below which a relative error is meaningless."
    )
    reported: int = convention(
        3, "Number of differing parameters listed one by one in the statement; the report lists all."
    )
    pairs_told: int = convention(2, "Number of correlated parameter pairs mentioned in the statement.")


@dataclass(frozen=True)
class BootstrapNumbers:
    """Number of bootstrap draws for standard errors."""

    replicates: int = budget(
        60, "Draws of a bootstrap: the relative error of the standard errors is 1 / sqrt(2 n), 9 percent."
    )
    fewest_replicates: int = budget(
        24, "Draws for long records: the relative error of the standard errors is 14 percent."
    )
    replicate_steps: int = budget(
        3_500_000,
        "Budget of integration steps for all draws, 2 to 3 s: slow models get fewer draws. A number of steps instead of a time, "
        "so that results do not depend on the computer.",
    )
    most_replicate_steps: int = budget(
        2_000_000,
        "Integration steps of one draw above which the covariance of the fit is used instead: a stiff model takes thousands per "
        "sample.",
    )
