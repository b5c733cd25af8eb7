"""What is told about records and numbers beside the verdict?"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number


@dataclass(frozen=True)
class NoteNumbers:
    """What is told about records and numbers beside the verdict? Each field carries its reason."""

    quiet_input: float = number(
        1e-3,
        "convention",
        "Share of its span within which an input counts as resting.",
    )
    quiet_noise: float = number(
        0.01,
        "convention",
        "Largest noise of an input at rest, relative to its span.",
    )
    quiet_deviations: float = number(
        5.0,
        "convention",
        "Standard deviations of its noise within which the steps of a resting input stay.",
    )
    least_rest: int = number(
        100,
        "convention",
        "Samples of rest below which it tells no noise.",
    )
    top_of_spectrum: float = number(
        0.85,
        "assumption",
        "Share of the lines above which no rig responds.",
    )
    another_amplitude: float = number(
        1.2,
        "convention",
        "Ratio from which two records have different amplitudes.",
    )
    clearly: float = number(
        5.0,
        "convention",
        (
            "Standard errors from zero at which a response or a shift counts where the residual is not white: "
            "they take it for white."
        ),
    )
    line_chance: float = number(
        1e-3,
        "convention",
        "Chance with which one line of two equal responses would differ as much.",
    )
    lines_changed: float = number(
        0.15,
        "assumption",
        "Share of independent lines that must differ: variances of sweeps may be too small on some.",
    )
    response_change: float = number(
        0.02,
        "convention",
        "Relative difference of a response that counts as a change.",
    )
    fewest_lines: int = number(
        8,
        "convention",
        "Lines below which two responses are not compared.",
    )
    nearly_all: float = number(
        0.8,
        "assumption",
        (
            "Share of the gap, as power, that a shift of the time base must explain to be told: where hysteresis "
            "delays the answer, a shift was seen to explain half."
        ),
    )
    least_shift: float = number(
        0.2,
        "convention",
        "Shift in sample times below which it is taken for none.",
    )
    most_lead: int = number(
        10,
        "convention",
        (
            "Samples by which outputs may come too early and still be told, where a search for a delay reaches "
            "that far."
        ),
    )
    shortest_stuck: int = number(
        20,
        "convention",
        "Samples of one value from which a sensor counts as stuck.",
    )
    longest_share_still: float = number(
        0.5,
        "convention",
        (
            "A channel that stands still for longer than this in other places too is a rig at rest, not a stuck "
            "sensor."
        ),
    )
    abrupt: float = number(
        0.5,
        "convention",
        "Step into or out of standing still, in root mean square steps, that no mass makes.",
    )
    one_step: float = number(
        1.5,
        "convention",
        "Least steps of a channel up to which a change is one of them.",
    )
    fewest_levels: int = number(
        200,
        "convention",
        "Levels over the span of a channel below which its resolution is told as coarse.",
    )
    jump_size: float = number(
        0.05,
        "convention",
        "Least size of a jump, in standard deviations of the channel.",
    )
    jump_contrast: float = number(
        8.0,
        "convention",
        "Factor by which a jump exceeds what is around it.",
    )
    jump_neighborhood: int = number(
        201,
        "convention",
        "Samples around a jump that it is compared with.",
    )
    first_told: int = number(
        3,
        "convention",
        "Faults of one kind that a sentence lists.",
    )
    far_off: float = number(
        100.0,
        "convention",
        (
            "Factor by which a number of the rig may change beside an effect before it is told: the effect has "
            "then taken its place."
        ),
    )
    disturbance_above: float = number(
        2.0,
        "convention",
        (
            "Power, in units of the noise, from which a line of a disturbance is read: nine lines of white noise "
            "reach it once in a hundred times."
        ),
    )
    advised_amplitudes: tuple[float, ...] = number(
        (0.3, 1.0, 1.5),
        "convention",
        (
            "Amplitudes of an advised experiment in units of the largest input that was recorded: beyond one and "
            "a half of it, a rig may not survive the advice."
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
