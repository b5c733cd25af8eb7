"""Thresholds of the notes on records and parameters."""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number


@dataclass(frozen=True)
class NoteNumbers:
    """Thresholds of the notes on records and parameters. Each field carries its reason."""

    quiet_input: float = number(
        1e-3,
        "convention",
        "Share of its range within which an input counts as constant.",
    )
    quiet_noise: float = number(
        0.01,
        "convention",
        "Largest noise of an input at rest, relative to its range.",
    )
    quiet_deviations: float = number(
        5.0,
        "convention",
        "Sample-to-sample changes of a resting input stay within this number of standard deviations of its noise.",
    )
    least_rest: int = number(
        100,
        "convention",
        "Minimum samples at rest for an estimate of the noise.",
    )
    top_of_spectrum: float = number(
        0.85,
        "assumption",
        "Share of the spectral lines above which no rig responds.",
    )
    another_amplitude: float = number(
        1.2,
        "convention",
        "Ratio above which two records count as having different amplitudes.",
    )
    clearly: float = number(
        5.0,
        "convention",
        (
            "Standard errors from zero at which a response or a shift counts as significant; large, because the residual is not "
            "white and the standard errors assume white noise."
        ),
    )
    line_chance: float = number(
        1e-3,
        "convention",
        "Probability that one spectral line of two equal responses differs this much.",
    )
    lines_changed: float = number(
        0.15,
        "assumption",
        "Share of independent spectral lines that must differ: the variances of sweeps may be too small at some lines.",
    )
    response_change: float = number(
        0.02,
        "convention",
        "Relative difference of a response that counts as a change.",
    )
    fewest_lines: int = number(
        8,
        "convention",
        "Minimum common spectral lines to compare two responses.",
    )
    nearly_all: float = number(
        0.8,
        "assumption",
        (
            "Share of the gap, as power, that a time offset must explain to be reported: with hysteresis, which delays the "
            "response, a time offset was seen to explain half."
        ),
    )
    least_shift: float = number(
        0.2,
        "convention",
        "Time offset in sample times below which it is neglected.",
    )
    most_lead: int = number(
        10,
        "convention",
        (
            "Largest number of samples by which outputs can precede the input and still be found by the search for a delay."
        ),
    )
    shortest_stuck: int = number(
        20,
        "convention",
        "Number of equal samples from which a sensor counts as stuck.",
    )
    longest_share_still: float = number(
        0.5,
        "convention",
        (
            "If a channel is constant in more than this share of its samples, the rig is at rest and the sensor is not stuck."
        ),
    )
    abrupt: float = number(
        0.5,
        "convention",
        "Jump at the start or end of a constant stretch, in RMS sample-to-sample changes, that is impossible for a mass.",
    )
    one_step: float = number(
        1.5,
        "convention",
        "Number of smallest increments of a channel up to which a change counts as quantization.",
    )
    per_drive: float = number(
        4.0,
        "assumption",
        (
            "Ratio of levels of a sensor to those of an input, each in its own motion, up to which the input explains them (runs "
            "forward and backward): a rig moves less fast than slowly."
        ),
    )
    rounding: float = number(
        1e-9,
        "convention",
        "Part of a channel's range below which a change between samples is rounding of its conversion, not an increment.",
    )
    fewest_levels: int = number(
        200,
        "convention",
        "Number of levels over the range of a channel below which its resolution is reported as coarse.",
    )
    jump_size: float = number(
        0.05,
        "convention",
        "Minimum size of a jump, in standard deviations of the channel.",
    )
    jump_contrast: float = number(
        8.0,
        "convention",
        "Factor by which a jump must exceed the changes around it.",
    )
    jump_neighborhood: int = number(
        201,
        "convention",
        "Number of samples around a jump that it is compared with.",
    )
    first_reported: int = number(
        3,
        "convention",
        "Number of faults of one kind listed in a sentence.",
    )
    far_off: float = number(
        100.0,
        "convention",
        (
            "Factor by which a parameter of the rig may change when an effect is added before it is reported: beyond it, the "
            "effect has replaced the parameter."
        ),
    )
    disturbance_above: float = number(
        2.0,
        "convention",
        (
            "Power, in units of the noise, above which a spectral line counts as a disturbance: one of nine lines of white noise "
            "reaches it with a probability of one in a hundred."
        ),
    )
    advised_amplitudes: tuple[float, ...] = number(
        (0.3, 1.0),
        "convention",
        (
            "Amplitudes of an advised experiment in units of the largest that stays within the recorded inputs: nothing shows "
            "that the rig bears more."
        ),
    )
    advised_periods: float = number(
        40.0,
        "convention",
        "Length of an advised experiment in periods of the rig's motion.",
    )
    advised_band: tuple[float, float] = number(
        (0.1, 5.0),
        "convention",
        "Band of an advised experiment in units of the rig's angular frequency.",
    )
