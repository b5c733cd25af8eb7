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
            "percent. An observer is made looser until a true model would leave no more of the sensors' noise."
        ),
    )
    exact: float = number(
        1.03,
        "assumption",
        (
            "Error in units of the floor above which something is left to explain: another parent is tried, an "
            "exponent is released, and the remainder of a single effect, or of two that are one law, is asked "
            "whether it is noise."
        ),
        set_by="14 pairs that were one law on drawn rigs: the two true ones left 0.99 and 1.01, seven others 1.05 to 1.10",
    )
    at_lower_bound: float = number(
        3.0,
        "assumption",
        (
            "What counts as the floor where only the top of the spectrum tells of the noise: white noise is taken "
            "to be at least a third of all."
        ),
    )
    worthwhile: float = number(
        1.1,
        "assumption",
        (
            "Factor by which a model, a hold or a shift must lower the error to be believed to explain anything, "
            "and below which two of them are alike."
        ),
    )
    least_left: float = number(
        1.15,
        "assumption",
        "What a named cause may leave, in units of a measured floor, of the smallest gaps.",
        set_by="141 drawn rigs: true causes left up to 1.08 of gaps below 5 floors, relatives of unknown ones 1.2 and more",
    )
    most_left: float = number(
        1.6,
        "assumption",
        (
            "The same for the largest gaps: a disturbance moves a rig with memory more than the resting rig "
            "shows."
        ),
        set_by="141 drawn rigs: true causes left up to 1.44 of a gap of 50 floors, relatives of unknown ones 4 and more",
    )
    left_of_gap: float = number(
        0.025,
        "assumption",
        (
            "The same in between: this share of the gap above the floor, so that a cause closes at least 97.5 % "
            "of it."
        ),
        set_by="the same 141 drawn rigs",
    )
    larger_part: float = number(
        0.5,
        "convention",
        (
            "What takes more than all else together is the main cause; one more effect must close the larger part "
            "of what is left; another form of the first effect that gains the larger part of what the second does "
            "explains more than it; places and effects with the larger part of the best push are looked at."
        ),
    )
    surely: float = number(
        0.05,
        "convention",
        (
            "Share of the resamplings in which something may fail and still counts as sure; models that come "
            "within the tolerance in more of them are told apart no further."
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
            "The same for a model that leaves more than a measured floor allows: that floor speaks against it "
            "already."
        ),
    )
    stretches: int = number(
        64,
        "measured",
        (
            "Stretches of all records together whose signs are turned: so many that a number which differs in one "
            "record shows, so few that what a disturbance does to a sticking mass hardly reaches from one into "
            "the next. Twice as long ones are asked for how evenly a remainder is spread."
        ),
        set_by="experiments/adequacy",
    )
    least_spread: float = number(
        0.25,
        "assumption",
        (
            "Share of the (longer) stretches over which a remainder must be spread, as their number that would "
            "hold its power evenly: noise is spread over nearly all."
        ),
    )
    standard_errors: float = number(
        3.0,
        "convention",
        (
            "Standard errors from zero, or from what is known, at which a number counts as needed: one chance in "
            "370."
        ),
    )
    comparable: float = number(
        1.5,
        "assumption",
        (
            "Factor of the best error within which a model is a contender: no form is exact. Contenders are "
            "fitted to full precision, asked how predictable their motion is, tried in each other's place, and "
            "preferred where the best has impossible numbers; a force that leaves so many floors explains what "
            "the sensors showed."
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
            "A noise floor measured at rest is refused if a model leaves less than this of it: the rig was moving "
            "at rest (it wanders in its play, it pulsates)."
        ),
        set_by="blind trials: true models left 0.82 and more of a true floor, 0.44 to 0.53 of a motion",
    )
    sensitive: float = number(
        3.0,
        "assumption",
        (
            "Growth of a disturbance, in units of what it does to the linear rig, from which the motion is too "
            "sensitive to be predicted over a whole record."
        ),
    )
    window_cycles: int = number(
        4,
        "assumption",
        "Cycles of motion in a window where the motion is too sensitive.",
        set_by="two drawn rigs with play of a few widths",
    )
    tie: float = number(
        0.01,
        "convention",
        "Relative difference of held-out errors that no engineer would build a decision on.",
    )
    inexact: float = number(
        1e-3,
        "assumption",
        (
            "Share of the gap, and of the error between models with as many numbers, by which models may differ "
            "without being told apart: no form is exact, and what disturbs the rig bends it."
        ),
        set_by="play with a disturbance left 4 % more than a stop with a weak spring beside it, of a gap of 48 floors",
    )
    hint: float = number(
        0.9,
        "assumption",
        (
            "Share of a win that goes to the lowest error among models that differ by more than that and less "
            "than a tie."
        ),
        set_by="12 of 12 blind trials with such a rival: the truth was the lower one",
    )
    prior_per_effect: float = number(
        1.0 / 3.0,
        "assumption",
        (
            "Odds of one more effect, or of a special shape of a simpler one, between models with as many numbers "
            "and the same error."
        ),
    )
    model_error: float = number(
        0.1,
        "assumption",
        "Share of what the best model leaves above the floor that may be worth nothing for the comparison.",
    )
    negligible: float = number(
        1e-3,
        "convention",
        (
            "Probability, in units of the best model's, that a model keeps however large its error; one whose "
            "evidence is no more is told apart."
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
            "Exponent of the evidence: one sample of ten counts, as no form, no hold of an input and no filter is "
            "exact."
        ),
        set_by="the best log score of seven exponents on 45 trials of the laboratory bench, seeds 5 and 6",
    )
    prior_outside: float = number(
        0.2,
        "assumption",
        "Share of causes that no catalogue holds, before any record is seen: one in five.",
    )
    set_coverage: float = number(
        0.9,
        "convention",
        "Share of diagnoses whose true cause shall be in the set of likely causes.",
    )
