"""What decides a verdict, how families weigh, and from where on something is noted?"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import assumption, convention, measured


@dataclass(frozen=True)
class VerdictNumbers:
    """What decides a verdict and its probability?"""

    at_floor: float = convention(
        1.1,
        "RMS error, in units of the noise floor, that counts as the floor itself: floors are known to a few percent. The "
        "bandwidth of an observer is reduced until a true model would leave no more than this of the sensor noise.",
    )
    exact: float = assumption(
        1.03,
        "Error, in units of the floor, above which there is something left to explain: other simpler models are extended, an "
        "exponent is released, and the remaining error of a single effect, or of two that act as one law, is tested for being "
        "noise.",
        "14 pairs that acted as one law on simulated random rigs: the two true ones left 0.99 and 1.01, seven others 1.05 to "
        "1.10",
    )
    at_lower_bound: float = assumption(
        3.0,
        "Limit that replaces the floor if the noise is known only from the top of the spectrum: white noise is assumed to be at "
        "least a third of all noise.",
    )
    worthwhile: float = assumption(
        1.1,
        "Factor by which a model, a hold or a time offset must lower the error to count as an explanation; two that differ by "
        "less count as equal.",
    )
    least_remainder: float = assumption(
        1.15,
        "Error, in units of a measured floor, that a named cause may leave of the smallest gaps.",
        "141 simulated random rigs: for gaps below 5 floors, true causes left up to 1.08 floors, effects similar to unknown "
        "ones 1.2 and more",
    )
    most_remainder: float = assumption(
        1.6,
        "The same for the largest gaps: a disturbance moves a rig with memory more than a measurement at rest shows.",
        "141 simulated random rigs: for a gap of 50 floors, true causes left up to 1.44 floors, effects similar to unknown ones "
        "4 and more",
    )
    remainder_of_gap: float = assumption(
        0.025,
        "The same for gaps in between: this share of the gap above the floor, so that a cause closes at least 97.5 % of it.",
        "the same 141 simulated random rigs",
    )
    larger_part: float = convention(
        0.5,
        "More than half of the gap makes a main cause. One more effect must close more than half of the remaining error. If "
        "another form of the first effect gains more than half of what a second effect gains, it is preferred to the second. "
        "Places and effects that explain at least half as much as the best one in the screening are examined. A delay must leave "
        "more than half of a record. A sensor was zeroed where more than half of a difference of means is there at the start.",
    )
    surely: float = convention(
        0.05,
        "Share of the resamplings in which a statement may fail and still counts as certain; models that are equal within the "
        "tolerance in more of them are not distinguished further, and a model with a larger share of the ranking is not "
        "distinguished from the named one.",
    )
    significance: float = convention(
        0.01, "p-value below which a model is not adequate: one adequate model of a hundred is refused."
    )
    against_a_floor: float = convention(
        0.1,
        "The same for a model that leaves more than a measured floor allows: the floor is already evidence against it.",
    )
    stretches: int = measured(
        64,
        "Number of stretches, over all records, whose signs are flipped in the randomization test: enough to show a parameter "
        "that differs in one record, but long enough that the effect of a disturbance on a sticking mass hardly extends from "
        "one into the next. Stretches twice as long are used to test how evenly the remaining error is spread.",
        "experiments/adequacy",
    )
    least_spread: float = assumption(
        0.25,
        "Share of the (longer) stretches over which the remaining error must be spread, as an effective number of stretches of "
        "equal power: noise is spread over nearly all.",
    )
    standard_errors: float = convention(
        3.0,
        "Standard errors from zero, or from the known value, at which a parameter counts as significant: a chance of one in 370.",
    )
    least_periods: float = assumption(
        3.0,
        "Periods of a tone in the longest record below which it is a slow force of any shape: its phase is free in each record.",
        "seen on one measured pendulum, whose damping was called a tone of one and a half periods",
    )
    comparable: float = assumption(
        1.5,
        "Factor of the best error within which a model is a contender, because no model is exact. Contenders are fitted to full "
        "precision, tested for sensitivity of the motion, tried in each other's place, and preferred if the best has impossible "
        "parameters. A joint at which a missing force leaves at most this factor more of the equations than the best is as "
        "likely a place.",
    )
    release_gain: float = assumption(
        1.02, "Factor by which a released exponent must lower the held-out error to be kept."
    )
    refutes_rest: float = assumption(
        0.7,
        "A noise floor measured at rest is rejected if a model leaves less than this of it: the rig was moving at rest (within "
        "its play, or periodically).",
        "blind trials: true models left 0.82 and more of a true floor, and 0.44 to 0.53 if the rig was moving",
    )
    sensitive: float = assumption(
        3.0,
        "Growth of a disturbance, relative to its effect on the linear rig, above which the motion is too sensitive to be "
        "predicted over a whole record.",
    )
    window_cycles: int = assumption(
        4,
        "Cycles of motion per window if the motion is too sensitive.",
        "two simulated random rigs with play of several widths",
    )
    tie: float = convention(0.01, "Relative difference of held-out errors that is irrelevant in practice.")
    inexact: float = assumption(
        1e-3,
        "Share of the gap, and of the error between models with equally many parameters, by which models may differ and still "
        "count as indistinguishable: no model is exact, and disturbances change the result. A single effect that leaves no more "
        "asks for no second one.",
        "in a gap of 48 floors, play with a disturbance left 4 % more than an end stop with a weak parallel spring",
    )
    hint: float = assumption(
        0.9,
        "Share of the probability that goes to the model with the lowest error, among models that differ by more than that but "
        "less than a tie.",
        "12 of 12 blind trials with such a rival: the truth was the lower one",
    )
    prior_per_effect: float = assumption(
        1.0 / 3.0,
        "Prior odds of one more effect, or of a special form of a simpler one, between models with equally many parameters and "
        "the same error.",
    )
    model_error: float = assumption(
        0.1, "Share of the error of the best model above the floor that is disregarded in the comparison."
    )
    negligible: float = convention(
        1e-3,
        "Probability, relative to the best model, that a model keeps however large its error; a model with no more evidence "
        "than this counts as distinguished.",
    )
    fall: float = convention(
        20.0,
        "Rate at which that probability falls with the relative difference of the error: to a third at 5 %.",
    )
    temper: float = measured(
        0.1,
        "Exponent of the evidence: one sample of ten counts, because no model, no hold of an input and no filter is exact.",
        "the best log score of seven exponents on 45 trials of the laboratory bench, seeds 5 and 6",
    )
    prior_outside: float = assumption(0.2, "Prior probability of a cause outside the catalogue: one in five.")
    set_coverage: float = convention(
        0.9, "Share of diagnoses whose true cause should be in the set of likely causes."
    )


@dataclass(frozen=True)
class FamilyNumbers:
    """How much does what a family explains say of it, where no law is exact?"""

    per_simulation: float = assumption(
        2.0,
        "Power of the share of the squared gap that a family leaves in a simulation: half the number of independent pieces of "
        "evidence that law errors leave in records.",
    )
    per_motion: float = measured(
        5.3,
        "The same for the share of the squared force that a family leaves along the measured motion; less where few independent "
        "rows leave much to chance.",
        "experiments/missing_force: known causes in measured records. Optimistic: the same forces along the same motion made "
        "these trials",
    )
    other_causes: float = measured(
        4.8,
        "Weight of a cause of no family of the catalogue, or of one that the motion does not judge; a family that explains "
        "nothing has the weight one.",
        "the same trials",
    )
    failing: float = measured(
        0.03,
        "Odds that the evidence itself fails, whatever it says: a fit ended elsewhere, or a form is unlike the true law at this "
        "place. They limit every probability.",
        "experiments/missing_force: 99 known causes in measured records, the largest likelihood; 0.018 to 0.032 by seed",
    )
    least_rank: float = assumption(
        0.1,
        "Share of the ranking that a family keeps at least: where no law is exact, held-out errors exclude none.",
        "seen on two measured rigs only (a pendulum, an electronic oscillator), not validated",
    )
    yields_at_once: float = assumption(
        0.1,
        "Deflection over which a hysteresis yields, as a share of the motion (its 98th percentile), below which it is dry "
        "friction: Coulomb friction then explains 70 to 97 % of the square of its force, in simulated motion of one and eight "
        "frequencies.",
        "set on measured rigs: dry friction of a lift and of two dampers yielded over 0.01 to 0.06 of the motion, the memory "
        "of a friction damper over 0.4",
    )
    lost_phase: float = convention(
        1.0,
        "Error of a simulated position, in radians of a wave over it, from which the simulation has lost the phase of the wave.",
    )
    probable: float = convention(
        0.5,
        "Probability from which the motion names a family, or a model a further one: it is more probable than not.",
    )
    listed: float = convention(
        0.01, "Smallest probability of a family that is listed although no named effect belongs to it."
    )
    limits: tuple[float, float] = convention(
        (0.025, 0.975), "Quantiles of the resamplings that bound a share: 95 % of them lie between."
    )


@dataclass(frozen=True)
class NoteNumbers:
    """Thresholds of the notes on records and parameters."""

    quiet_input: float = convention(1e-3, "Share of its range within which an input counts as constant.")
    quiet_noise: float = convention(0.01, "Largest noise of an input at rest, relative to its range.")
    quiet_deviations: float = convention(
        5.0,
        "Sample-to-sample changes of a resting input stay within this number of standard deviations of its noise.",
    )
    least_rest: int = convention(100, "Minimum samples at rest for an estimate of the noise.")
    top_of_spectrum: float = assumption(0.85, "Share of the spectral lines above which no rig responds.")
    another_amplitude: float = convention(
        1.2, "Ratio above which two records count as having different amplitudes."
    )
    clearly: float = convention(
        5.0,
        "Standard errors from zero at which a response or a shift counts as significant; large, because the residual is not "
        "white and the standard errors assume white noise.",
    )
    line_chance: float = convention(
        1e-3, "Probability that one spectral line of two equal responses differs this much."
    )
    lines_changed: float = assumption(
        0.15,
        "Share of independent spectral lines that must differ: the variances of sweeps may be too small at some lines.",
    )
    response_change: float = convention(0.02, "Relative difference of a response that counts as a change.")
    fewest_lines: int = convention(8, "Minimum common spectral lines to compare two responses.")
    nearly_all: float = assumption(
        0.8,
        "Share of the gap, as power, that a time offset must explain to be reported: with hysteresis, which delays the "
        "response, a time offset was seen to explain half.",
    )
    least_shift: float = convention(0.2, "Time offset in sample times below which it is neglected.")
    most_lead: int = convention(
        10,
        "Largest number of samples by which outputs can precede the input and still be found by the search for a delay.",
    )
    shortest_stuck: int = convention(20, "Number of equal samples from which a sensor counts as stuck.")
    longest_share_still: float = convention(
        0.5,
        "If a channel is constant in more than this share of its samples, the rig is at rest and the sensor is not stuck.",
    )
    abrupt: float = convention(
        0.5,
        "Jump at the start or end of a constant stretch, in RMS sample-to-sample changes, that is impossible for a mass.",
    )
    one_step: float = convention(
        1.5, "Number of smallest increments of a channel up to which a change counts as quantization."
    )
    per_drive: float = assumption(
        4.0,
        "Ratio of levels of a sensor to those of an input, each in its own motion, up to which the input explains them (runs "
        "forward and backward): a rig moves less fast than slowly.",
    )
    rounding: float = convention(
        1e-9,
        "Part of a channel's range below which a change between samples is rounding of its conversion, not an increment.",
    )
    fewest_levels: int = convention(
        200, "Number of levels over the range of a channel below which its resolution is reported as coarse."
    )
    jump_size: float = convention(0.05, "Minimum size of a jump, in standard deviations of the channel.")
    jump_contrast: float = convention(8.0, "Factor by which a jump must exceed the changes around it.")
    jump_neighborhood: int = convention(201, "Number of samples around a jump that it is compared with.")
    first_reported: int = convention(3, "Number of faults of one kind listed in a sentence.")
    far_off: float = convention(
        100.0,
        "Factor by which a parameter of the rig may change when an effect is added before it is reported: beyond it, the effect "
        "has replaced the parameter.",
    )
    disturbance_above: float = convention(
        2.0,
        "Power, in units of the noise, above which a spectral line counts as a disturbance: one of nine lines of white noise "
        "reaches it with a probability of one in a hundred.",
    )
    advised_amplitudes: tuple[float, ...] = convention(
        (0.3, 1.0),
        "Amplitudes of an advised experiment in units of the largest that stays within the recorded inputs: nothing shows that "
        "the rig bears more.",
    )
    advised_periods: float = convention(
        40.0, "Length of an advised experiment in periods of the rig's motion."
    )
    advised_band: tuple[float, float] = convention(
        (0.1, 5.0), "Band of an advised experiment in units of the rig's angular frequency."
    )
