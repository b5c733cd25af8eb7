"""The error that a named cause does not explain: its share of the gap and the signal with which it correlates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rigsight.diagnose.fitting.fit_context import FittedModel
from rigsight.diagnose.noise.adequacy import CONCENTRATED, Adequacy
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.pushes.alternatives import BY_RECORD


@dataclass(frozen=True)
class Remainder:
    """Error of the diagnosed model above noise and disturbance."""

    # Of the squared gap of the re-identified equations; 0 where it correlates with nothing and so counts as
    # noise and disturbance.
    share: float
    # Joint, drive or sensor at which it arises; empty where it correlates with nothing, or with no place.
    where: tuple[str, ...]
    # Signal, time or record with which it correlates, or that it is concentrated in a few stretches; empty
    # where there is none.
    goes_with: str
    # Probability that noise and disturbance alone correlate this well with anything that was tested.
    p_value: float
    # True if the verdict names a cause: then the remaining error is in addition to it.
    beside_a_cause: bool = True

    @property
    def text(self) -> str:
        """The same in one sentence."""
        if not self.goes_with:
            return (
                f"The remaining error correlates with no motion, drive, reading, time or record that was tested (p = "
                f"{self.p_value:.2g}): it counts as noise and disturbance."
            )
        if self.share == 0.0:
            return (
                f"The remaining error is within the noise floor, but it still correlates with {_in_words(self.goes_with)} (p = "
                f"{self.p_value:.2g}): parameters may be off by more than their standard errors."
            )
        percent = float(f"{100.0 * self.share:.2g}")
        reported = f"The remaining error, {percent:g} % of the squared gap,"
        remainder = (
            f"{reported} is concentrated in {CONCENTRATED}, unlike noise"
            if self.goes_with == CONCENTRATED
            else f"{reported} still correlates with {_in_words(self.goes_with)} (p = {self.p_value:.2g})"
        )
        if self.share > VERDICT.larger_part:
            return f"{remainder}: more than half of the gap is not explained."
        if not self.beside_a_cause:
            return f"{remainder}."
        return f"{remainder}: a smaller effect is missing too, or the equation does not quite fit the rig."

    def to_json(self) -> dict[str, Any]:
        """Return the entry ``remainder`` of ``diagnosis.json``."""
        return {
            "share": self.share,
            "where": list(self.where),
            "goes_with": self.goes_with or None,
            "p_value": self.p_value,
            "text": self.text,
        }


def _in_words(goes_with: str) -> str:
    """Return the correlated signal as part of a sentence."""
    kind, _, what = goes_with.partition(BY_RECORD)
    return goes_with if kind else f"the record: {what} differs from record to record"


def remainder_of(
    reidentified: FittedModel, model: FittedModel, found: Adequacy, lower_bound: bool, beside_a_cause: bool
) -> Remainder:
    """Return the remaining error of a model."""
    if found.adequate:
        return Remainder(0.0, (), "", found.p_value, beside_a_cause)
    # What is concentrated in a few stretches remains whole, whatever small part correlates with something by chance.
    share = 1.0 if found.goes_with == CONCENTRATED or not found.agreements else found.agreements[0].share
    above = share * model.error_over_noise**2 if lower_bound else max(model.error_over_noise**2 - 1.0, 0.0)
    whole = (
        reidentified.error_over_noise**2
        if lower_bound
        else max(reidentified.error_over_noise**2 - 1.0, 1e-300)
    )
    where = (found.place,) if found.place else ()
    return Remainder(min(1.0, above / whole), where, found.goes_with, found.p_value, beside_a_cause)
