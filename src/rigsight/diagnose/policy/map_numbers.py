"""With which resolution is the gap mapped?"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number


@dataclass(frozen=True)
class MapNumbers:
    """With which resolution is the gap mapped? Each field carries its reason."""

    bands: int = number(
        8,
        "convention",
        "Bands of frequency into which the gap is split.",
    )
    segments: int = number(
        8,
        "convention",
        "Number of segments of a record whose spectra are averaged.",
    )
    fewest_band_samples: int = number(
        64,
        "convention",
        "Minimum samples of a segment.",
    )
    beyond_the_input: float = number(
        1e-2,
        "convention",
        "Share of the input's power that may lie on either side of the excited range.",
    )
    beyond_the_answer: float = number(
        1e-3,
        "convention",
        (
            "Share of the response power that may lie above this range: after a step the rig rings at frequencies where the "
            "input has little power."
        ),
    )
    stands_out: float = number(
        4.0,
        "convention",
        "Ratio of response power to noise power at which a frequency counts as responding.",
    )
    rests: float = number(
        1e-3,
        "convention",
        "Relative deviation within which a signal counts as constant.",
    )
    cells: int = number(
        9,
        "convention",
        "Cells along each axis of the state plane.",
    )
    cutoff_margin: float = number(
        1.5,
        "convention",
        "Cutoff of the smoothing of motions, in units of the highest responding frequency.",
    )
    highest_cutoff: float = number(
        0.8,
        "convention",
        "Upper limit of this cutoff, in units of the Nyquist frequency.",
    )
    filter_order: int = number(
        4,
        "convention",
        "Order of that filter.",
    )
    time_stretches: int = number(
        24,
        "convention",
        "Stretches of time into which a record is cut.",
    )
    fewest_stretch_samples: int = number(
        20,
        "convention",
        "Minimum samples of such a stretch.",
    )
    least_noise: int = number(
        250,
        "convention",
        "Minimum samples of pure noise for an estimate of its spectrum.",
    )
    mapped_samples: int = number(
        8000,
        "budget",
        (
            "Maximum samples for which the motion of joints is reconstructed: about a second of processor time per thousand on a "
            "drive train."
        ),
    )
    slowest_rate: float = number(
        1e-3,
        "convention",
        "Slowest rate searched on the lateral section, in units of the inverse length of the longest record.",
    )
    fastest_rate: float = number(
        1.0,
        "convention",
        "Fastest rate, in units of the inverse sample time.",
    )
    largest_shift: float = number(
        0.05,
        "convention",
        "Largest shift, in units of the longest record.",
    )
    limits: tuple[float, ...] = number(
        (0.025, 0.975),
        "convention",
        "Quantiles of the intervals of the gap budget.",
    )
