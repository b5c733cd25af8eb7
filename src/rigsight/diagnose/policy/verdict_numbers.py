"""What decides a verdict and its probability?"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number


@dataclass(frozen=True)
class VerdictNumbers:
    """What decides a verdict and its probability? Each field carries its reason."""

    at_floor: float = number(
        1.1,
        "convention",
        (
            "RMS error, in units of the noise floor, that counts as the floor itself: floors are known to a few "
            "percent. The bandwidth of an observer is reduced until a true model would leave no more than this of the sensor "
            "noise."
        ),
    )
    exact: float = number(
        1.03,
        "assumption",
        (
            "Error, in units of the floor, above which there is something left to explain: other simpler models are extended, an "
            "exponent is released, and the remaining error of a single effect, or of two that act as one law, is tested for "
            "being noise."
        ),
        set_by="14 pairs that acted as one law on simulated random rigs: the two true ones left 0.99 and 1.01, seven others 1.05 "
        "to 1.10",
    )
    at_lower_bound: float = number(
        3.0,
        "assumption",
        (
            "Limit that replaces the floor if the noise is known only from the top of the spectrum: white noise is assumed to be "
            "at least a third of all noise."
        ),
    )
    worthwhile: float = number(
        1.1,
        "assumption",
        (
            "Factor by which a model, a hold or a time offset must lower the error to count as an explanation; two that differ "
            "by less count as equal."
        ),
    )
    least_remainder: float = number(
        1.15,
        "assumption",
        "Error, in units of a measured floor, that a named cause may leave of the smallest gaps.",
        set_by="141 simulated random rigs: for gaps below 5 floors, true causes left up to 1.08 floors, effects similar to "
        "unknown ones 1.2 and more",
    )
    most_remainder: float = number(
        1.6,
        "assumption",
        (
            "The same for the largest gaps: a disturbance moves a rig with memory more than a measurement at rest shows."
        ),
        set_by="141 simulated random rigs: for a gap of 50 floors, true causes left up to 1.44 floors, effects similar to "
        "unknown ones 4 and more",
    )
    remainder_of_gap: float = number(
        0.025,
        "assumption",
        (
            "The same for gaps in between: this share of the gap above the floor, so that a cause closes at least 97.5 % of it."
        ),
        set_by="the same 141 simulated random rigs",
    )
    larger_part: float = number(
        0.5,
        "convention",
        (
            "More than half of the gap makes a main cause. One more effect must close more than half of the remaining error. If "
            "another form of the first effect gains more than half of what a second effect gains, it is preferred to the second. "
            "Places and effects that explain at least half as much as the best one in the screening are examined."
        ),
    )
    surely: float = number(
        0.05,
        "convention",
        (
            "Share of the resamplings in which a statement may fail and still counts as certain; models that are equal within "
            "the tolerance in more of them are not distinguished further, and a model with a larger share of the ranking is not "
            "distinguished from the named one."
        ),
    )
    significance: float = number(
        0.01,
        "convention",
        "p-value below which a model is not adequate: one adequate model of a hundred is refused.",
    )
    against_a_floor: float = number(
        0.1,
        "convention",
        (
            "The same for a model that leaves more than a measured floor allows: the floor is already evidence against it."
        ),
    )
    stretches: int = number(
        64,
        "measured",
        (
            "Number of stretches, over all records, whose signs are flipped in the randomization test: enough to show a "
            "parameter that differs in one record, but long enough that the effect of a disturbance on a sticking mass hardly "
            "extends from one into the next. Stretches twice as long are used to test how evenly the remaining error is spread."
        ),
        set_by="experiments/adequacy",
    )
    least_spread: float = number(
        0.25,
        "assumption",
        (
            "Share of the (longer) stretches over which the remaining error must be spread, as an effective number of stretches "
            "of equal power: noise is spread over nearly all."
        ),
    )
    standard_errors: float = number(
        3.0,
        "convention",
        (
            "Standard errors from zero, or from the known value, at which a parameter counts as significant: a chance of one in "
            "370."
        ),
    )
    comparable: float = number(
        1.5,
        "assumption",
        (
            "Factor of the best error within which a model is a contender, because no model is exact. Contenders are fitted to "
            "full precision, tested for sensitivity of the motion, tried in each other's place, and preferred if the best has "
            "impossible parameters. A joint at which a missing force leaves at most this factor more of the equations than the "
            "best is as likely a place."
        ),
    )
    release_gain: float = number(
        1.02,
        "assumption",
        "Factor by which a released exponent must lower the held-out error to be kept.",
    )
    refutes_rest: float = number(
        0.7,
        "assumption",
        (
            "A noise floor measured at rest is rejected if a model leaves less than this of it: the rig was moving at rest "
            "(within its play, or periodically)."
        ),
        set_by="blind trials: true models left 0.82 and more of a true floor, and 0.44 to 0.53 if the rig was moving",
    )
    sensitive: float = number(
        3.0,
        "assumption",
        (
            "Growth of a disturbance, relative to its effect on the linear rig, above which the motion is too sensitive to be "
            "predicted over a whole record."
        ),
    )
    window_cycles: int = number(
        4,
        "assumption",
        "Cycles of motion per window if the motion is too sensitive.",
        set_by="two simulated random rigs with play of several widths",
    )
    tie: float = number(
        0.01,
        "convention",
        "Relative difference of held-out errors that is irrelevant in practice.",
    )
    inexact: float = number(
        1e-3,
        "assumption",
        (
            "Share of the gap, and of the error between models with equally many parameters, by which models may differ and "
            "still count as indistinguishable: no model is exact, and disturbances change the result. A single effect that "
            "leaves no more asks for no second one."
        ),
        set_by="in a gap of 48 floors, play with a disturbance left 4 % more than an end stop with a weak parallel spring",
    )
    hint: float = number(
        0.9,
        "assumption",
        (
            "Share of the probability that goes to the model with the lowest error, among models that differ by more than that "
            "but less than a tie."
        ),
        set_by="12 of 12 blind trials with such a rival: the truth was the lower one",
    )
    prior_per_effect: float = number(
        1.0 / 3.0,
        "assumption",
        (
            "Prior odds of one more effect, or of a special form of a simpler one, between models with equally many parameters "
            "and the same error."
        ),
    )
    model_error: float = number(
        0.1,
        "assumption",
        "Share of the error of the best model above the floor that is disregarded in the comparison.",
    )
    negligible: float = number(
        1e-3,
        "convention",
        (
            "Probability, relative to the best model, that a model keeps however large its error; a model with no more evidence "
            "than this counts as distinguished."
        ),
    )
    fall: float = number(
        20.0,
        "convention",
        "Rate at which that probability falls with the relative difference of the error: to a third at 5 %.",
    )
    temper: float = number(
        0.1,
        "measured",
        (
            "Exponent of the evidence: one sample of ten counts, because no model, no hold of an input and no filter is exact."
        ),
        set_by="the best log score of seven exponents on 45 trials of the laboratory bench, seeds 5 and 6",
    )
    prior_outside: float = number(
        0.2,
        "assumption",
        "Prior probability of a cause outside the catalogue: one in five.",
    )
    set_coverage: float = number(
        0.9,
        "convention",
        "Share of diagnoses whose true cause should be in the set of likely causes.",
    )
