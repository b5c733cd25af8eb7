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
            "Bandwidth of the fastest observer, in units of the typical frequency of the velocity: low enough that the harmonics "
            "of friction remain visible."
        ),
    )
    observer_loose: float = number(
        0.1,
        "assumption",
        "The same for the slowest observer: errors accumulate over ten periods.",
    )
    observer_holds: float = number(
        2.0,
        "assumption",
        (
            "Bandwidth of the slowest observer of an unstable mass, in units of its fastest pole: from the pole itself on it is "
            "stable, and from 1.4 times the pole on also with negative damping."
        ),
    )
    observer_step: float = number(
        2.0,
        "budget",
        "Ratio of the bandwidths of successive observers.",
    )
    observer_sampling: float = number(
        0.2,
        "convention",
        "Largest product of bandwidth and sample time: a faster observer follows the noise of single samples.",
    )
    clear_gap: float = number(
        10.0,
        "convention",
        "Gap, in units of the noise floor, that is large enough to show its cause.",
    )
    piece: float = number(
        4.0,
        "assumption",
        (
            "Length of a piece with its own initial state, in periods of the rig: an inaccurate model stays in phase with the "
            "motion for about this long."
        ),
        set_by="simulated random rigs with play of several widths: pieces of half to two periods were worse",
    )
    examined: int = number(
        8000,
        "budget",
        (
            "Number of samples, of all records together, to which candidates are first fitted: fits to whole records of 40 s "
            "take four times as long."
        ),
    )
    most_pieces: int = number(
        40,
        "budget",
        "Largest number of pieces of all records per degree of freedom: every piece adds its own initial state.",
    )
    rough_evaluations_of_rig: int = number(
        8,
        "budget",
        "Evaluations of the rig's equations from each other set of start values.",
    )
    lost: float = number(
        3.0,
        "assumption",
        (
            "RMS error of the given simulation, in standard deviations of a reading, from which on several bodies are not "
            "run free. Two motions of one size in opposite phase differ by two."
        ),
        set_by="an arm whose free run ends ten deviations off",
    )
