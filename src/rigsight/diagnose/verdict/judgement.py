"""From scored models to a verdict: none, parameters, effect or unknown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from rigsight.diagnose.fitting.fit_context import FittedModel
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.verdict.main_cause import MainCause

Verdict = Literal["effect", "parameters", "none", "unknown"]


@dataclass(frozen=True)
class Judgement:
    """A verdict with the model that stands for it and the reason in words."""

    verdict: Verdict
    model: FittedModel
    reason: str
    by_motion: bool = False  # whether the missing force along the motion decides, not the simulations


def most_remainder(gap: float) -> float:
    """Return the error that a named cause may leave, in units of a measured noise floor, for a gap in the same units."""
    return min(
        max(VERDICT.least_remainder, 1.0 + VERDICT.remainder_of_gap * (gap - 1.0)), VERDICT.most_remainder
    )


def judge(
    error_before: float,
    reidentified: FittedModel,
    best: FittedModel,
    is_adequate: Callable[[FittedModel], bool],
    cause: Callable[[], MainCause],
    lower_bound: bool = False,
) -> Judgement:
    """Return the verdict on the held-out errors, all in units of the noise floor."""
    at_floor = VERDICT.at_lower_bound if lower_bound else VERDICT.at_floor
    helps = best.error_over_noise * VERDICT.worthwhile < reidentified.error_over_noise
    retuned = reidentified.error_over_noise * VERDICT.worthwhile < error_before
    needs_effect = helps and reidentified.error_over_noise > VERDICT.at_floor
    # Parameters fitted to a record similar to the held-out ones may fit these by chance although no parameters fit all records.
    if not needs_effect and (error_before <= VERDICT.at_floor or (error_before <= at_floor and not retuned)):
        return Judgement("none", reidentified, "The error of the given simulation is within the noise floor.")
    if not needs_effect and reidentified.error_over_noise <= at_floor:
        if retuned:
            return Judgement(
                "parameters",
                reidentified,
                "The same equations with refitted parameters reach the noise floor.",
            )
        return Judgement(
            "none", reidentified, "The gap is too small, compared with the noise floor, to find a cause."
        )
    if not helps:
        if not is_adequate(reidentified):
            return Judgement(
                "unknown", reidentified, "No effect of the catalogue lowers the validation error."
            )
        noisy = (
            f"The error of the equations, {reidentified.error_over_noise:.3g} times the noise floor, correlates with no signal "
            f"that was tested: the noise floor is too low."
        )
        if retuned:
            return Judgement(
                "parameters", reidentified, f"{noisy} Refitted parameters explain the rest of the gap."
            )
        return Judgement("none", reidentified, noisy)
    closed = (reidentified.error_over_noise - best.error_over_noise) / (reidentified.error_over_noise - 1.0)
    floor = "the lower bound of the noise floor" if lower_bound else "the noise floor"
    allowed = VERDICT.at_lower_bound if lower_bound else most_remainder(reidentified.error_over_noise)
    nearest = f"{', '.join(best.names)} closes {closed:.0%} of the re-identified gap"
    if best.error_over_noise <= VERDICT.at_floor:
        return Judgement("effect", best, "With the effect the simulation reaches the noise floor.")
    if best.error_over_noise <= allowed and closed >= VERDICT.larger_part:
        return Judgement("effect", best, f"{nearest} and leaves {best.error_over_noise:.3g} times {floor}.")
    if is_adequate(best):
        return Judgement(
            "effect",
            best,
            f"{nearest}; its error, {best.error_over_noise:.3g} times {floor}, correlates with no signal that was tested and "
            f"counts as noise and disturbance.",
        )
    taken = cause()
    if taken.clear:
        place = " at that place"
        if taken.equalled_by:
            place = f". Effects at other places explain the same part of it ({_listed(taken.equalled_by)})"
        if taken.contradicted_by:
            place = f". Effects at other places explain as much, but another part of it ({_listed(taken.contradicted_by)})"
        return Judgement(
            "effect",
            best,
            f"{nearest}: the main cause, or the most similar effect of the catalogue{place}. It leaves "
            f"{best.error_over_noise:.3g} times {floor}, and this error still correlates with a signal of the rig.",
        )
    return Judgement(
        "unknown",
        best,
        f"The best candidate, {', '.join(best.names)}, explains {taken.share:.0%} of the squared gap (at least "
        f"{taken.at_least:.0%} with 95 % confidence): a cause that is named explains more than half.",
    )


def _listed(models: Sequence[FittedModel]) -> str:
    return "; ".join(", ".join(model.names) for model in models[:3])
