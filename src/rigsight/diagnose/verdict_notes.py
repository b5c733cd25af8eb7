"""Which notes stand beside a verdict: on the records, on how models were compared, and on what the verdict leaves open?

A rule is one function that returns a sentence or None. A new one joins one of the two tuples; its sentence stands where the tuple
is read in `verdict_notes`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.examination import Examination
from rigsight.diagnose.policy import FAMILIES, VERDICT
from rigsight.diagnose.search.horizon import growth_of_disturbances
from rigsight.diagnose.verdict.families import yielding_part
from rigsight.identify.closed_loop import closed_loop_notes
from rigsight.records.record import Floats

_REFERENCE_USED = (
    "It is used as instrument when the frequency responses of two amplitudes are compared, if the input responds to it in both; "
    "the responses in the report do not use it."
)


@dataclass(frozen=True)
class Basis:
    """What the notes are based on."""

    campaign: Campaign  # records and the given simulation
    found: Examination  # what the examination found
    rng: np.random.Generator  # for rules that simulate disturbances
    # The error of a model, in units of the noise floor measured at rest, that refuted this floor; None where
    # none did.
    below_rest: float | None = None


Rule = Callable[[Basis], str | None]


def verdict_notes(basis: Basis) -> tuple[str, ...]:
    """Return all notes, in the order in which they are read."""
    campaign, found = basis.campaign, basis.found
    return (
        *campaign.notes,
        *(note for record in campaign.records for note in record.notes),
        *closed_loop_notes(campaign.records, campaign.rig, _REFERENCE_USED),
        *_reported(ON_THE_COMPARISON, basis),
        *found.quality.notes,
        found.judgement.reason,
        *found.doubts,
        *_reported(ON_WHAT_STAYS_OPEN, basis),
    )


def _reported(rules: Sequence[Rule], basis: Basis) -> list[str]:
    return [sentence for rule in rules if (sentence := rule(basis)) is not None]


def open_factor_note(basis: Basis) -> str | None:
    """Tell that a factor common to several parameters is open."""
    factor = basis.campaign.open_factor
    return None if factor is None else factor.sentence


def moving_at_rest_note(basis: Basis) -> str | None:
    """Tell that what was measured at rest is more than noise, because a model's error is smaller."""
    if basis.below_rest is None:
        return None
    return (
        f"A model's error is {basis.below_rest:.2g} of the noise floor measured at rest. So the rig was moving at rest, "
        f"within its play or driven by a disturbance; the noise floor is taken from the top of the spectrum instead."
    )


def observer_note(basis: Basis) -> str | None:
    """Tell that models are compared as observers."""
    bandwidth = basis.found.windowing.bandwidth
    if bandwidth is None:
        return None
    held = " A large mass hardly leaves that motion, whatever force it lacks: so fits must also explain the force along it."
    return (
        f"The rig has no restoring force, so every model drifts in free run. Models are compared as observers: each tracks "
        f"the measured motion up to {bandwidth:.3g} rad/s, so the errors are those that build up within "
        f"{1.0 / bandwidth:.2g} s.{held if basis.found.context.along_motion is not None else ''}"
    )


def windows_note(basis: Basis) -> str | None:
    """Tell that records are cut into windows of some cycles."""
    cycles = basis.found.windowing.cycles
    if cycles is None:
        return None
    return (
        "In free run the motion is sensitive to small disturbances: one as small as the noise would change it by much more "
        f"than the noise. The records are fitted and scored in windows of {cycles} cycles, each with its own "
        "initial state."
    )


def sensitive_motion_note(basis: Basis) -> str | None:
    """Tell that the error of the best model in free run may be chance, if the cause is unknown."""
    found = basis.found
    if found.windowing.cycles is not None or found.judgement.verdict != "unknown":
        return None
    growth = growth_of_disturbances(found.context, found.reidentified, found.judgement.model, basis.rng)
    if growth <= VERDICT.sensitive:
        return None
    return (
        f"The motion of the best model is sensitive to small disturbances: one as small as the noise changes it by "
        f"{growth:.2g} times the noise, so its error may be chance. Record more motion or shorter records to find out."
    )


def imitations_note(basis: Basis) -> str | None:
    """Tell which two effects imitate an unknown cause without being named."""
    if basis.found.judgement.verdict != "unknown" or not basis.found.imitations:
        return None
    nearest = min(basis.found.imitations, key=lambda pair: pair.error_over_noise)
    return (
        f"Together {' and '.join(nearest.names)} leave {nearest.error_over_noise:.3g} times the noise floor, but they act as "
        f"a single law, and other laws of this kind fit equally well, so they are not named."
    )


def clocks_note(basis: Basis) -> str | None:
    """Tell that a delay is shorter than the clocks of the records can tell."""
    model, reported = basis.found.judgement.model, []
    least = max((record.clock_uncertainty for record in basis.campaign.records), default=0.0)
    for effect in model.effects if model is not None and least > 0.0 else ():
        late = [expression for expression in (effect.delay, effect.reading_delay) if expression is not None]
        symbols = {str(symbol) for expression in late for symbol in expression.free_symbols}
        for parameter in effect.parameters:
            value = model.fit.values[model.fit.structure.parameter_name(effect, parameter.name)]
            if parameter.name in symbols and abs(value) < least:
                reported.append(f"{effect.name} of {abs(value):.2g} s")
    if not reported:
        return None
    return (
        f"{' and '.join(reported)}: shorter than the {least:.2g} s by which time stamps of the records may be wrong (they "
        "jitter, or signals have clocks of their own), so it may come from the clocks, not from the rig. Record all signals "
        "with one clock to find out."
    )


def yielding_note(basis: Basis) -> str | None:
    """Tell why a hysteresis counts as dry friction."""
    model, scales = basis.found.judgement.model, basis.found.context.scales
    for effect in model.effects:
        part = yielding_part(model, effect, scales)
        if part is not None and part < FAMILIES.yields_at_once:
            return (
                f"{effect.name} yields over {part:.1%} of the motion, less than {FAMILIES.yields_at_once:.0%}: it counts as dry "
                "friction, which gives way elastically before it slides."
            )
    return None


def worse_record_note(basis: Basis) -> str | None:
    """Tell which record the named effects make worse."""
    found = basis.found
    model, without, context = found.judgement.model, found.reidentified, found.context
    if found.judgement.verdict != "effect":
        return None
    squares: dict[str, Floats] = {}
    for records, left, before in (
        (context.estimation, model.fit.residuals, without.fit.residuals),
        (context.scoring, model.residuals, without.residuals),
    ):
        for record, *both in zip(records, left, before, strict=False):
            own = np.array([np.nansum((residual / context.floors) ** 2) for residual in both])
            squares[record.origin] = squares.get(record.origin, np.zeros(2)) + own
    factors = {
        name: float(np.sqrt(left / before)) for name, (left, before) in squares.items() if before > 0.0
    }
    worst = max(factors, key=lambda name: factors[name], default="")
    if not worst or factors[worst] <= VERDICT.worthwhile:
        return None
    return (
        f"In record '{worst}' the error with {', '.join(model.names)} is {factors[worst]:.2g} times that without: something else "
        "is missing there, or the effect has another form."
    )


ON_THE_COMPARISON: tuple[Rule, ...] = (
    open_factor_note,
    moving_at_rest_note,
    observer_note,
    windows_note,
    sensitive_motion_note,
)
"""How models were compared; read before the reason of the verdict."""
ON_WHAT_STAYS_OPEN: tuple[Rule, ...] = (imitations_note, yielding_note, worse_record_note, clocks_note)
"""Read after the reason of the verdict and the doubts about parameters."""
