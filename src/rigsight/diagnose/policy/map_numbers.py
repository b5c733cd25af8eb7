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
        "Segments of a record whose spectra are averaged.",
    )
    fewest_band_samples: int = number(
        64,
        "convention",
        "Samples of a segment at least.",
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
            "Share of the answer's power that may lie above it: after a step the rig rings where the input has "
            "little power."
        ),
    )
    stands_out: float = number(
        4.0,
        "convention",
        "Power over that of the noise at which a frequency counts as answered.",
    )
    rests: float = number(
        1e-3,
        "convention",
        "Share of its size within which a signal rests.",
    )
    cells: int = number(
        9,
        "convention",
        "Cells along each axis of the state plane.",
    )
    cutoff_margin: float = number(
        1.5,
        "convention",
        "Factor of the highest answered frequency at which motions are smoothed.",
    )
    highest_cutoff: float = number(
        0.8,
        "convention",
        "The same in units of the Nyquist frequency at most.",
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
        "Samples of such a stretch at least.",
    )
    least_noise: int = number(
        250,
        "convention",
        "Samples of noise alone below which its spectrum is not worth a guess.",
    )
    mapped_samples: int = number(
        8000,
        "budget",
        (
            "Samples of joint motion that are followed: about a second of processor time per thousand on a drive "
            "train."
        ),
    )
    slowest_rate: float = number(
        1e-3,
        "convention",
        "Slowest rate looked for on the lateral leg, in units of the inverse length of the longest record.",
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
