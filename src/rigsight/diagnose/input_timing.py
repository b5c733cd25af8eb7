"""Would another hold of the input, or a constant shift of the time base, explain what a model leaves?

The model is fitted again to the liveliest stretches of the records under each hypothesis. A shift is a delay whose zero is moved:
the outputs are paired with inputs some samples earlier, so that a fitted delay shorter than that is a lead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from rigsight.diagnose.finding import Finding
from rigsight.diagnose.workbench import Workbench
from rigsight.effects import Effect, effect_named
from rigsight.identify import FitResult, GreyBoxFit
from rigsight.records.record import Hold, Record

_EVALUATIONS = 10
_TOLERANCE = 1e-3
_ACCURACY = 1e-3
_LEAD = 10
"""Samples by which outputs may come too early and still be told."""
_GAP = 1.1
"""RMS in units of the noise floor above which there is something to explain."""
_GOOD_PART = 0.5
"""Share of the gap, as power, that a hypothesis must explain to be told; an assumption."""
_AS_GOOD = 0.1
"""Difference of such shares at which the plainer hypothesis, a hold, is preferred to a shift."""
_LEAST_SHIFT = 0.2
"""Shift in sample times below which it is taken for none."""
_DELAYS = ("input_delay", "sensor_delay")


@dataclass(frozen=True)
class InputTiming:
    """What a model leaves on the liveliest stretches under each hypothesis.

    Attributes
    ----------
    given
        Hold as declared.
    as_given
        RMS of the residuals in units of the noise floor, with that hold.
    with_hold
        The same with every other hold.
    with_shift
        The same with the declared hold and a free shift; None where it was not tried.
    shift
        Fitted shift [s], positive where the outputs come late; None as above.
    dt
        Longest sample time of the records [s].
    """

    given: Hold
    as_given: float
    with_hold: Mapping[Hold, float]
    with_shift: float | None
    shift: float | None
    dt: float

    def explained(self, excess: float) -> float:
        """Return the share of the gap above the floor, as power, that goes where only `excess` is left."""
        gap = self.as_given**2 - 1.0
        return 0.0 if gap <= 0.0 else float(np.clip((self.as_given**2 - excess**2) / gap, 0.0, 1.0))

    def findings(self) -> list[Finding]:
        """Return the hypotheses that explain a good part of what the model leaves."""
        if not self.as_given > _GAP:
            return []
        best = min(self.with_hold, key=lambda hold: self.with_hold[hold])
        by_hold = self.explained(self.with_hold[best])
        by_shift = 0.0 if self.with_shift is None else self.explained(self.with_shift)
        if by_hold >= _GOOD_PART and by_hold >= by_shift - _AS_GOOD:
            return [self._hold_finding(best, by_hold, by_shift)]
        if by_shift >= _GOOD_PART and self.shift is not None and abs(self.shift) > _LEAST_SHIFT * self.dt:
            return [self._shift_finding(self.shift, by_shift)]
        return []

    def _hold_finding(self, best: Hold, by_hold: float, by_shift: float) -> Finding:
        rival = ""
        if self.shift is not None and by_shift >= by_hold - _AS_GOOD:
            rival = f" A shift of the time base by {1e3 * self.shift:.3g} ms would explain {by_shift:.0%}."
        return Finding(
            "hold",
            f'Between its samples the input runs as hold = "{best}" rather than "{self.given}": that alone explains '
            f"{by_hold:.0%} of the gap ({self.as_given:.3g} -> {self.with_hold[best]:.3g} times the noise floor).{rival}",
            f'Set hold = "{best}" for the records in campaign.toml, if the drive can work like that.',
            explained=by_hold,
        )

    def _shift_finding(self, shift: float, by_shift: float) -> Finding:
        if shift < 0.0:
            return Finding(
                "time_shift",
                f"The outputs come {-1e3 * shift:.3g} ms before the input that causes them: a shift of the time base explains "
                f"{by_shift:.0%} of the gap ({self.as_given:.3g} -> {self.with_shift:.3g} times the noise floor).",
                "Align the channels: no rig answers before it is asked.",
                explained=by_shift,
            )
        return Finding(
            "time_shift",
            f"The outputs come {1e3 * shift:.3g} ms late: a shift of the time base would explain {by_shift:.0%} of the gap "
            f"({self.as_given:.3g} -> {self.with_shift:.3g} times the noise floor), and so would a delay or a short lag in the rig.",
            "Make sure that input and outputs share one clock before an effect is blamed.",
            serious=False,
            explained=by_shift,
        )


def input_timing(bench: Workbench, effects: tuple[Effect, ...], base: FitResult) -> InputTiming | None:
    """Fit a model to the liveliest stretches with every hold, and with a shift of the time base.

    Parameters
    ----------
    bench
        Records, scales and noise.
    effects
        Effects of the model beside those that the simulation has.
    base
        Fit of the model to the records with the hold as declared.

    Returns
    -------
    None where the motion is prescribed, the records' holds differ, or the model cannot be fitted to the stretches.
    """
    given = {record.hold for record in bench.look}
    if not bench.rig.is_driven or len(given) != 1:
        return None
    (declared,) = given
    as_given = _excess(bench, base, bench.look)
    if not np.isfinite(as_given):
        return None
    others: tuple[Hold, ...] = tuple(hold for hold in get_args(Hold) if hold != declared)
    shift, with_shift = _shifted(bench, effects, base)
    return InputTiming(
        given=declared,
        as_given=as_given,
        with_hold={
            hold: _excess(bench, base, [replace(record, hold=hold) for record in bench.look])
            for hold in others
        },
        with_shift=with_shift,
        shift=shift,
        dt=max(record.dt for record in bench.look),
    )


def _excess(bench: Workbench, base: FitResult, records: Sequence[Record]) -> float:
    return _refitted(bench, base, base.values, base.free, records).weighted_rms


def _refitted(
    bench: Workbench,
    base: FitResult,
    start: Mapping[str, float],
    free: Sequence[str],
    records: Sequence[Record],
) -> FitResult:
    fit = GreyBoxFit(base.structure, records, bench.scales, bench.noise, _ACCURACY)
    return fit.fit(start, free, max_evaluations=_EVALUATIONS, tolerance=_TOLERANCE, finish=False)


def _shifted(
    bench: Workbench, effects: tuple[Effect, ...], base: FitResult
) -> tuple[float | None, float | None]:
    """Return the fitted shift and what is left with it."""
    names = {effect.name for effect in (*bench.modelled, *effects)}
    if names & set(_DELAYS) or any(record.n_samples <= 10 * _LEAD for record in bench.look):
        return None, None
    delay = effect_named("input_delay")
    structure = bench.composed((*effects, delay), dict(base.structure.fixed))
    name = structure.parameter_name(delay, delay.parameters[0].name)
    paired = [_outputs_later(record, [s.name for s in bench.rig.outputs]) for record in bench.look]
    lead = _LEAD * max(record.dt for record in bench.look)
    result = _refitted(
        bench, replace(base, structure=structure), {**base.values, name: lead}, (*base.free, name), paired
    )
    if not np.isfinite(result.cost):
        return None, None
    return result.values[name] - lead, result.weighted_rms


def _outputs_later(record: Record, outputs: Sequence[str]) -> Record:
    """Return the record with its outputs moved to later times by `_LEAD` samples."""
    signals = {
        name: samples[:-_LEAD] if name in outputs else samples[_LEAD:]
        for name, samples in record.signals.items()
    }
    return replace(record, signals=signals)
