"""Would another hold of the input, or a constant time offset, explain the residual of a model?

The model is refitted to the most excited stretches of the records under each hypothesis. A time offset is fitted as a delay: the
outputs are paired with inputs some samples earlier, so that a fitted delay shorter than that is a lead.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from rigsight.diagnose.data_quality.finding import Finding
from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import NOTES, SEARCH, VERDICT
from rigsight.effects import Effect, effect_named, kind_of
from rigsight.identify import FitResult
from rigsight.records.record import Hold, Record
from rigsight.records.signals import is_constant
from rigsight.simulate import carried_over

_TOLERANCE = 1e-3
_DELAYS = ("input_delay", "sensor_delay")


@dataclass(frozen=True)
class InputTiming:
    """Error of a model on the most excited stretches under each hypothesis."""

    given: Hold  # hold as declared
    as_given: float  # RMS of the residuals in units of the noise floor, with that hold
    with_hold: Mapping[Hold, float]  # the same with every other hold
    with_shift: float | None  # the same with the declared hold and a free shift; None where it was not tried
    shift: float | None  # fitted shift [s], positive where the outputs come late; None as above
    dt: float  # longest sample time of the records [s]

    def explained(self, error_over_noise: float) -> float:
        """Return the explained share of the gap above the floor, as power, if the error falls to `error_over_noise`."""
        gap = self.as_given**2 - 1.0
        return 0.0 if gap <= 0.0 else float(np.clip((self.as_given**2 - error_over_noise**2) / gap, 0.0, 1.0))

    def findings(self) -> list[Finding]:
        """Return the hypotheses that explain a large part of the residual."""
        if not self.as_given > VERDICT.at_floor:
            return []
        least = min(self.with_hold.values())
        alike = [
            hold
            for hold, error_over_noise in self.with_hold.items()
            if error_over_noise <= VERDICT.worthwhile * least
        ]
        shifted = math.inf if self.with_shift is None else self.with_shift
        by_hold, by_shift = self.explained(least), self.explained(shifted)
        if by_hold >= VERDICT.larger_part and least <= VERDICT.worthwhile * shifted:
            return [self._hold_finding(alike, least, shifted)]
        if (
            by_shift >= NOTES.nearly_all
            and self.shift is not None
            and abs(self.shift) > NOTES.least_shift * self.dt
        ):
            return [self._shift_finding(self.shift, by_shift)]
        return []

    def _hold_finding(self, holds: Sequence[Hold], least: float, shifted: float) -> Finding:
        reported = " or ".join(f'"{hold}"' for hold in holds)
        rival = ""
        if self.shift is not None and shifted <= VERDICT.worthwhile * least:
            rival = f" So would a time offset of {1e3 * self.shift:.3g} ms"
            rival += ", or a delay in the rig." if self.shift > 0.0 else "."
        return Finding(
            "hold",
            f'Between samples the input follows hold = {reported} rather than "{self.given}": this alone explains '
            f"{self.explained(least):.0%} of the gap ({self.as_given:.3g} -> {least:.3g} times the noise floor).{rival}",
            f"Set hold = {reported} for the records in campaign.toml, if the drive works like this.",
            serious=not (rival and self.shift is not None and self.shift > 0.0),
            explained=self.explained(least),
        )

    def _shift_finding(self, shift: float, by_shift: float) -> Finding:
        if shift < 0.0:
            return Finding(
                "time_shift",
                f"The outputs come {-1e3 * shift:.3g} ms before the input that causes them: a time offset explains "
                f"{by_shift:.0%} of the gap ({self.as_given:.3g} -> {self.with_shift:.3g} times the noise floor).",
                "Align the channels: the output precedes the input.",
                explained=by_shift,
            )
        return Finding(
            "time_shift",
            f"The outputs come {1e3 * shift:.3g} ms late: a time offset would explain {by_shift:.0%} of the gap "
            f"({self.as_given:.3g} -> {self.with_shift:.3g} times the noise floor). So would a delay or a short lag in the rig.",
            "Check that input and outputs share one clock before you look for an effect.",
            serious=False,
            explained=by_shift,
        )


def input_timing(
    context: FitContext, effects: tuple[Effect, ...], base: FitResult, with_shift: bool = True
) -> InputTiming | None:
    """Fit a model to the most excited stretches with every hold, and with a time offset."""
    given, names = {record.hold for record in context.look}, [signal.name for signal in context.rig.inputs]
    moves = any(not is_constant(record[name]) for record in context.estimation for name in names)
    if not context.rig.is_driven or not moves or len(given) != 1:
        return None
    (declared,) = given
    as_given = _error_over_noise(context, base, context.look)
    if not np.isfinite(as_given):
        return None
    others: tuple[Hold, ...] = tuple(hold for hold in get_args(Hold) if hold != declared)
    shift, shifted = _shifted(context, effects, base) if with_shift else (None, None)
    return InputTiming(
        given=declared,
        as_given=as_given,
        with_hold={
            hold: _error_over_noise(context, base, [replace(record, hold=hold) for record in context.look])
            for hold in others
        },
        with_shift=shifted,
        shift=shift,
        dt=max(record.dt for record in context.look),
    )


def without_short_delays(context: FitContext, model: FittedModel) -> tuple[tuple[Effect, ...], FitResult]:
    """Return the effects of a model but the delays that are shorter than a sample, and its fit without them."""
    fit, dt = model.fit, max(record.dt for record in context.look)

    def is_short_delay(effect: Effect) -> bool:
        if kind_of(effect.name) not in _DELAYS:
            return False
        return fit.values[fit.structure.parameter_name(effect, effect.parameters[0].name)] < dt

    effects = tuple(effect for effect in model.effects if not is_short_delay(effect))
    if effects == model.effects:
        return effects, fit
    structure = context.composed(effects, dict(fit.structure.fixed))
    values = {**fit.values, **carried_over(fit.values, fit.structure, structure)}
    names = set(structure.names)
    return effects, replace(
        fit,
        structure=structure,
        free=tuple(name for name in fit.free if name in names),
        values={name: values[name] for name in structure.names},
    )


def _error_over_noise(context: FitContext, base: FitResult, records: Sequence[Record]) -> float:
    return _refitted(context, base, base.values, base.free, records).weighted_rms


def _refitted(
    context: FitContext,
    base: FitResult,
    start: Mapping[str, float],
    free: Sequence[str],
    records: Sequence[Record],
) -> FitResult:
    fit = context.problem(base.structure, records)
    return fit.fit(start, free, max_evaluations=SEARCH.timing_evaluations, tolerance=_TOLERANCE, finish=False)


def _shifted(
    context: FitContext, effects: tuple[Effect, ...], base: FitResult
) -> tuple[float | None, float | None]:
    """Return the fitted time offset and the remaining error."""
    if not context.rig.has_one_motion:
        return None, None  # with control loops and several drives a shift is no delay of one input
    names = {effect.name for effect in (*context.modelled, *effects)}
    dt = context.look[0].dt
    if names & set(_DELAYS) or any(not math.isclose(record.dt, dt, rel_tol=1e-6) for record in context.look):
        return None, None
    delay = effect_named("input_delay")
    # The start, a shift of zero, lies in the middle of what the search for a delay explores.
    reach = 0.5 * delay.parameters[0].search[1] * context.scales["time"]
    n_lead = int(np.clip(reach / dt, 1, NOTES.most_lead))
    structure = context.composed((*effects, delay), dict(base.structure.fixed))
    name = structure.parameter_name(delay, delay.parameters[0].name)
    outputs = [signal.name for signal in context.rig.outputs]
    paired = [_outputs_later(record, outputs, n_lead) for record in context.look]
    lead = n_lead * dt
    result = _refitted(
        context, replace(base, structure=structure), {**base.values, name: lead}, (*base.free, name), paired
    )
    if not np.isfinite(result.cost):
        return None, None
    return result.values[name] - lead, result.weighted_rms


def _outputs_later(record: Record, outputs: Sequence[str], count: int) -> Record:
    """Return the record with its outputs moved to later times by `count` samples."""
    signals = {
        name: samples[:-count] if name in outputs else samples[count:]
        for name, samples in record.signals.items()
    }
    return replace(record, signals=signals)
