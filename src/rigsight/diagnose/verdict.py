"""From scored models to a verdict: none, parameters, effect or unknown."""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.result import Verdict
from rigsight.diagnose.workbench import Scored

AT_FLOOR = 1.1
"""RMS in units of the noise floor that counts as the floor itself: floors are known to a few percent."""
_WORTHWHILE = 1.1
"""Factor by which a model must lower the held-out error to be believed to explain anything."""
_HALF = 0.5
"""Share of the re-identified gap that an effect must close to be named its cause."""


@dataclass(frozen=True)
class Judgement:
    """A verdict with the model that stands for it and the reason in words."""

    verdict: Verdict
    model: Scored
    reason: str


def judge(before_excess: float, linear: Scored, best: Scored) -> Judgement:
    """Return the verdict on the held-out errors, all in units of the noise floor.

    Parameters
    ----------
    before_excess
        RMS that the given simulation leaves.
    linear
        The re-identified equations.
    best
        The best model with an effect.
    """
    if before_excess <= AT_FLOOR:
        return Judgement("none", linear, "The given simulation leaves no more than the noise floor.")
    helps = best.excess * _WORTHWHILE < linear.excess
    if linear.excess <= AT_FLOOR or not helps:
        if linear.excess * _WORTHWHILE < before_excess and linear.excess <= AT_FLOOR:
            return Judgement(
                "parameters", linear, "Better numbers for the same equations reach the noise floor."
            )
        if linear.excess <= AT_FLOOR:
            return Judgement("none", linear, "The gap is too small against the noise floor to have a cause.")
        return Judgement("unknown", linear, "No effect of the catalogue lowers the held-out error.")
    closed = (linear.excess - best.excess) / (linear.excess - 1.0)
    if best.excess > AT_FLOOR and closed < _HALF:
        return Judgement(
            "unknown",
            best,
            f"The best candidate ({', '.join(best.names)}) closes only {closed:.0%} of the re-identified gap.",
        )
    if best.excess <= AT_FLOOR:
        return Judgement("effect", best, "With the effect the simulation reaches the noise floor.")
    return Judgement(
        "effect",
        best,
        f"The effect closes {closed:.0%} of the re-identified gap but leaves {best.excess:.3g} times the noise floor: "
        f"something smaller is missing too, or its form differs.",
    )
