"""What is a number of a model asked before it is called the same everywhere?"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number


@dataclass(frozen=True)
class TrustNumbers:
    """What is a number asked before it is called the same everywhere? Each field carries its reason."""

    level: float = number(
        0.01,
        "convention",
        "Probability that any number of a model without a fault is said to differ, all tests together (Holm): the level at which "
        "adequacy refuses a model, so that the two do not contradict each other more often than that.",
    )
    in_order: float = number(
        0.9,
        "convention",
        "Share of the squared differences that a monotonic course must take where the rest is beyond chance: no effect is quite "
        "monotonic, and with small errors the smallest step back is beyond chance.",
    )
    fewest_in_time: int = number(
        3,
        "convention",
        "Records from which an order of time is told: two always grow or fall.",
    )
    one_level: float = number(
        1.1,
        "convention",
        "Ratio up to which measured amplitudes count as one level: repeats differ by some percent, ladders go up by more.",
    )
    windows: tuple[int, int] = number(
        (2, 4),
        "convention",
        "Windows into which each record is cut: halves and quarters.",
    )
    window_samples: int = number(
        100,
        "convention",
        "Samples of the shortest window: in less its own initial state takes most of what it says; as for other windows.",
    )
    window_periods: float = number(
        2.0,
        "convention",
        "Natural periods of the shortest window: damping and stiffness are read off a swing to and fro at least.",
    )
    periods_alone: float = number(
        15.0,
        "measured",
        "Natural periods of a window that is compared with the others of its record: in fewer a resonance is one spectral line "
        "wide, and what a disturbance does there is a single draw.",
        "axis with a damping ratio of 0.08 and a disturbing force of up to 80 noises: with quarters of 9.5 periods 3 of 30 right "
        "models were said to differ along the record, with halves of 19 one of 80",
    )
    worth_a_step: float = number(
        0.05,
        "convention",
        "Share of a record's squared error from which its own numbers are looked for beyond one linearization: where the common "
        "ones are right, ten numbers take a hundredth of a thousand samples of noise.",
    )
    own_steps: int = number(
        5,
        "budget",
        "Gauss-Newton steps of a record that asks for other numbers.",
    )
    state_evaluations: int = number(
        15,
        "budget",
        "Evaluations in which initial states of windows settle at their record's numbers.",
    )
    unsure: float = number(
        30.0,
        "convention",
        "Times the error of the best group from which a poorly known value of another is left out: it weighs a thousandth.",
    )
    least_freedom: float = number(
        2.0,
        "convention",
        "Degrees of freedom that a fit leaves of the noise in the narrowest band: those of one spectral line.",
    )
    correlated: float = number(
        0.99,
        "convention",
        "Correlation from which two numbers are said to be hardly told apart: each would be seven times surer if the other were "
        "known.",
    )
    one_to_one: float = number(
        0.2,
        "convention",
        "By how much relative errors of two numbers may differ and still be called those of a ratio or product.",
    )
    vague: float = number(
        0.1,
        "convention",
        "Relative error by group from which agreement says little: a tenth more is another number to an engineer.",
    )
    may_be_zero: float = number(
        3.0,
        "convention",
        "Standard errors from zero up to which a relative error says nothing.",
    )
    told: int = number(
        3,
        "convention",
        "Numbers that differ told one by one in the statement; the report has all.",
    )
    pairs_told: int = number(
        2,
        "convention",
        "Pairs of numbers that go together told in the statement.",
    )
