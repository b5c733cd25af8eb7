"""Thresholds of the tests whether a parameter is the same everywhere."""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number


@dataclass(frozen=True)
class TrustNumbers:
    """What is a number asked before it is called the same everywhere? Each field carries its reason."""

    level: float = number(
        0.01,
        "convention",
        "Probability that any parameter of a correct model is reported as differing, over all tests (Holm). It equals the level "
        "of the adequacy test, so that the two contradict each other no more often than that.",
    )
    in_order: float = number(
        0.9,
        "convention",
        "Share of the squared differences that a monotonic trend must explain if the rest is significant: no effect is exactly "
        "monotonic, and with small errors the smallest deviation is significant.",
    )
    fewest_in_time: int = number(
        3,
        "convention",
        "Minimum number of records for a trend over time: two always rise or fall.",
    )
    one_level: float = number(
        1.1,
        "convention",
        "Ratio up to which measured amplitudes count as one level: repeats differ by a few percent, steps between levels are "
        "larger.",
    )
    windows: tuple[int, int] = number(
        (2, 4),
        "convention",
        "Windows into which each record is cut: halves and quarters.",
    )
    window_samples: int = number(
        100,
        "convention",
        "Minimum samples of the shortest window: in fewer, its own initial state uses up most of the information; the same as "
        "for other windows.",
    )
    window_periods: float = number(
        2.0,
        "convention",
        "Natural periods of the shortest window: damping and stiffness need at least one full oscillation.",
    )
    periods_alone: float = number(
        15.0,
        "measured",
        "Minimum natural periods of a window that is compared with others of its record: in fewer, a resonance is only one "
        "spectral line wide, so the effect of a disturbance there is a single random draw.",
        "axis with a damping ratio of 0.08 and a disturbing force of up to 80 noises: with quarters of 9.5 periods 3 of 30 right "
        "models were said to differ along the record, with halves of 19 one of 80",
    )
    worth_a_step: float = number(
        0.05,
        "convention",
        "Reduction of a record's squared error by its own parameters above which they are refined beyond one linearization: with "
        "correct common parameters, ten parameters explain a hundredth of a thousand samples of noise.",
    )
    own_steps: int = number(
        5,
        "budget",
        "Gauss-Newton steps for a record that needs other parameters.",
    )
    state_evaluations: int = number(
        15,
        "budget",
        "Evaluations in which the initial states of windows are fitted at the parameters of their record.",
    )
    unsure: float = number(
        30.0,
        "convention",
        "A value whose error exceeds that of the best group by this factor is left out: its weight would be a thousandth.",
    )
    least_freedom: float = number(
        2.0,
        "convention",
        "Degrees of freedom of the noise that remain after a fit in the narrowest band: those of one spectral line.",
    )
    correlated: float = number(
        0.99,
        "convention",
        "Correlation above which two parameters are reported as hardly separable: the standard error of each would be seven "
        "times smaller if the other were known.",
    )
    one_to_one: float = number(
        0.2,
        "convention",
        "Relative difference up to which the errors of two parameters count as those of a ratio or product.",
    )
    vague: float = number(
        0.1,
        "convention",
        "Relative error per group above which agreement means little: an engineer regards a difference of a tenth as a different "
        "value.",
    )
    may_be_zero: float = number(
        3.0,
        "convention",
        "Standard errors from zero below which a relative error is meaningless.",
    )
    reported: int = number(
        3,
        "convention",
        "Number of differing parameters listed one by one in the statement; the report lists all.",
    )
    pairs_told: int = number(
        2,
        "convention",
        "Number of correlated parameter pairs mentioned in the statement.",
    )
