"""Does each sensor need its own offset in each record? This is tested before a second effect is accepted.

A sensor that was zeroed again shifts a whole record. An effect with memory and a free initial state does nearly the same, so that
it could be named as a second effect by mistake. Therefore models without memory are tested first.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.data_quality.finding import Finding
from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import NOTES, SEARCH, VERDICT
from rigsight.effects import Place
from rigsight.identify import OFFSETS_MEND, DifferingMeans, differing_means, swallowed_by_offsets
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate.equilibrium import can_drift

_TOLERANCE = 1e-5
_KEPT = 'Write offsets = "per_record" at the top of campaign.toml to do this in every command.'


def asked_offsets(
    context: FitContext, reidentified: FittedModel, singles: Sequence[FittedModel], allowed: float
) -> Finding | None:
    """Return the evidence for an offset in each record, None where there is none."""
    # The model must explain the records once offsets are free: an asymmetric effect, whose mean grows with the motion, also
    # shifts records but leaves more than offsets do.
    models = [reidentified, *(m for m in singles if m.fit.residuals and np.isfinite(m.error_over_noise))]
    forgetful = [m for m in models if not any(e.states and e.place is Place.DYNAMICS for e in m.effects)]
    # With the means gone they come nearest.
    nearest = [min(some, key=lambda m: _cost_without_means(context, m)) for some in (forgetful, models)]
    for model in nearest[:1] if nearest[0] is nearest[1] else nearest:
        reported = means_of(context, model)
        if not reported:
            continue
        freed = _with_free_offsets(context, model)
        gained = model.error_over_noise**2 - freed.error_over_noise**2
        if freed.error_over_noise <= allowed and gained > VERDICT.larger_part * (
            model.error_over_noise**2 - 1.0
        ):
            worst = max(reported, key=lambda one: one.share)
            unit = next(signal.unit for signal in context.rig.outputs if signal.name == worst.output)
            return Finding(
                "offset",
                f"{worst.sentence(unit)} With a free offset for each sensor in each record, the best model leaves "
                f"{freed.error_over_noise:.3g} times the noise floor instead of {model.error_over_noise:.3g}. These offsets are "
                f"estimated here but are not part of the model.",
                _KEPT,
                signal=worst.output,
            )
    return None


def levels_apart(context: FitContext, records: Sequence[Record]) -> list[Finding]:
    """Return the sensors whose mean differs between records by more than they move in any: fits start badly from there."""
    # Springs return a rig to the same place if its inputs and constants are the same; nothing is reported otherwise, or for a rig
    # that can rest anywhere.
    rig = context.rig
    if not _comes_back(context, records) or any(
        _apart(records, signal.name)[0] > 1.0 for signal in rig.inputs
    ):
        return []
    found = []
    for signal in rig.outputs:
        holding = [r for r in records if signal.name in r and signal.name not in r.free_offsets]
        moves, lowest, highest = _apart(holding, signal.name)
        pair = [record for record in holding if record.name in (lowest, highest)]
        driven = max((_apart(pair, one.name)[0] for one in rig.inputs), default=0.0)
        if moves > max(1.0, NOTES.per_drive * driven) and _begin_apart(pair, signal.name):
            found.append(
                Finding(
                    "offset",
                    f"{signal.name} has means in '{lowest}' and '{highest}' that differ by {moves:.3g} times its motion in any "
                    f"record.",
                    OFFSETS_MEND,
                    signal=signal.name,
                )
            )
    return found


def _comes_back(context: FitContext, records: Sequence[Record]) -> bool:
    """Return True if springs bring the rig to one place, the same in all records."""
    rig = context.rig
    if rig.has_one_motion:
        return context.has_stiffness
    if not rig.mechanism.free or any(record.constants != records[0].constants for record in records):
        return False
    constants = {p.name: context.start[p.name] for p in rig.constants if p.name in context.start}
    return not can_drift(rig, {**constants, **context.given})


def _apart(records: Sequence[Record], name: str) -> tuple[float, str, str]:
    """Return how far apart the levels of a signal lie in units of its largest motion, and the records between which they do."""
    levels = {record.name: float(np.mean(record[name])) for record in records}
    if len(levels) < 2:
        return 0.0, "", ""
    lowest, highest = (choose(levels, key=levels.__getitem__) for choose in (min, max))
    apart, motion = levels[highest] - levels[lowest], max(float(np.ptp(record[name])) for record in records)
    return apart / motion if motion > 0.0 else float("inf") if apart > 0.0 else 0.0, lowest, highest


def _begin_apart(pair: Sequence[Record], name: str) -> bool:
    """Return True if the larger part of the difference of two means is there at the first sample: a sensor was zeroed."""
    one, other = (record[name] for record in pair)
    return bool(abs(one[0] - other[0]) >= VERDICT.larger_part * abs(np.mean(one) - np.mean(other)))


def means_of(context: FitContext, model: FittedModel) -> list[DifferingMeans]:
    """Return the outputs whose mean residual differs between records."""
    records, residuals = list(context.estimation), list(model.fit.residuals)
    if context.scoring != context.estimation:
        records, residuals = [*records, *context.scoring], [*residuals, *model.residuals]
    if not (model.residuals and model.fit.residuals):
        return []
    names = [record.origin for record in records]
    return differing_means(names, records, residuals, [signal.name for signal in context.rig.outputs])


def with_offsets_free(campaign: Campaign) -> Campaign:
    """Return a campaign in which each sensor has an offset of its own in each record."""
    return replace(campaign, records=_freed(campaign.rig, campaign.records))


def _cost_without_means(context: FitContext, model: FittedModel) -> float:
    """Return the sum of squared weighted residuals about their mean in each record."""
    parts = [residual / context.floors for residual in model.fit.residuals]
    return float(sum(np.nansum((part - np.mean(part, axis=0)) ** 2) for part in parts))


def _freed(rig: Rig, records: Iterable[Record]) -> tuple[Record, ...]:
    outputs = [signal.name for signal in rig.outputs]
    return tuple(record.with_free_offsets(outputs) for record in records)


def _with_free_offsets(context: FitContext, model: FittedModel) -> FittedModel:
    """Fit and score a model with free offsets, from where it ended without them."""
    own = replace(
        context,
        estimation=_freed(context.rig, context.estimation),
        scoring=_freed(context.rig, context.scoring),
    )
    structure, values = model.fit.structure, model.fit.values
    swallowed = swallowed_by_offsets(
        structure, own.estimation, context.scales, context.noise, values, model.fit.free
    )
    free = [name for name in model.fit.free if name not in swallowed]
    fit = own.problem(structure, own.estimation).fit(
        values, free, None, SEARCH.offset_evaluations, _TOLERANCE
    )
    return own.score(model.effects, fit) if fit.residuals else replace(model, error_over_noise=float("inf"))
