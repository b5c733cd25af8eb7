"""Over which stretch is a model compared with records?"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number


@dataclass(frozen=True)
class HorizonNumbers:
    """Over which stretch is a model compared with records? Each field carries its reason."""

    observer_close: float = number(
        6.0,
        "assumption",
        (
            "Bandwidth of the closest observer, in units of the typical frequency of the velocity: the harmonics "
            "of friction that turns with the velocity still show."
        ),
    )
    observer_loose: float = number(
        0.1,
        "assumption",
        "The same of the loosest: errors add up for ten periods.",
    )
    observer_step: float = number(
        2.0,
        "budget",
        "Factor from one observer to the next.",
    )
    observer_sampling: float = number(
        0.2,
        "convention",
        "Largest bandwidth times sample time: a closer observer follows the noise of single samples.",
    )
    clear_gap: float = number(
        10.0,
        "convention",
        "Gap, in units of the noise floor, that shows its cause.",
    )
    piece: float = number(
        4.0,
        "assumption",
        (
            "Length of a piece, in periods of the rig, with initial states of its own: a model that is far off "
            "stays in step with the motion for about as long."
        ),
        set_by="drawn rigs with play of a few widths: half to two periods did worse",
    )
    most_pieces: int = number(
        40,
        "budget",
        "Pieces of all records for each degree of freedom: every piece has initial states of its own.",
    )
    died_away: float = number(
        0.99,
        "convention",
        (
            "Share of the squared steps of an output after which a free motion is smaller than a tenth of what it "
            "was."
        ),
    )
    fewest_in_motion: int = number(
        100,
        "convention",
        "Samples of a free motion that are kept at least.",
    )
    rough_evaluations_of_rig: int = number(
        8,
        "budget",
        "Evaluations of the rig's equations with other start values.",
    )
    window_periods: float = number(
        10.0,
        "assumption",
        "Length of a window in typical periods, where a rig drifts and no sensor shows its motion.",
    )
    window_samples: int = number(
        100,
        "convention",
        "Samples of such a window at least.",
    )
    most_windows: int = number(
        40,
        "budget",
        "Such windows of a record at most.",
    )
    fewest_window_samples: int = number(
        60,
        "convention",
        "Samples of a window of cycles at least.",
    )
    crossing_above_noise: float = number(
        3.0,
        "convention",
        "Deviation from the middle, in units of the noise, from which a crossing of it is one of the motion.",
    )
