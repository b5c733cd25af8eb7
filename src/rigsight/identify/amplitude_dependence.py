"""Do the parameters of single records change with the amplitude, beyond their intervals?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import chi2

from rigsight.identify.identification import RecordIdentification
from rigsight.identify.transfer.physical_parameters import PhysicalEstimates
from rigsight.records.record import Record
from rigsight.records.signals import is_constant
from rigsight.rigs import Rig
from rigsight.units import behind

_CHANCE = 1e-3
"""Probability of an equal or larger difference by chance, over all parameters, below which a parameter counts as changing."""
_SAME_AMPLITUDE = 0.01
_SAME_INERTIA = 2.0
"""Ratio of fitted inertias from which a nonlinear effect is not the likely cause; an assumption."""
_INERTIAS = ("kg", "kg m^2")
_MOVED = 1.15
"""Ratio of resonance frequencies that the scatter of a peak does not explain."""


def amplitude_dependence(
    records: Sequence[RecordIdentification], units: Mapping[str, str]
) -> tuple[str, tuple[str, ...]]:
    """Return a sentence on whether parameters change with the amplitude, and the names of those that do."""
    # Only records of one kind with different amplitudes are compared, because a step and a sweep also differ in frequency
    # content. Offsets are not compared; they may differ from record to record without any nonlinearity.
    compared = _comparable(records)
    if len(compared) < 2:
        return _why_not(records), ()
    parts = (_numbers(r) for _, group in compared for r in group)
    names = []
    for part in zip(*parts, strict=True):
        first, *others = [[] if own is None else _determined(own) for own in part]
        names += [name for name in first if all(name in other for other in others)]
    span_unit = behind(units.get(compared[0][1][0].source, ""))
    span = f"from {compared[0][0]:.3g} to {compared[-1][0]:.3g}{span_unit}"
    if not names:
        return f"No parameter was found at all amplitudes {span}; nothing can be compared.", ()
    changing, reported = [], []
    for name in names:
        means = [_mean([record.estimates[name] for record in group]) for _, group in compared]
        if not all(np.isfinite(error) for _, error in means) or _chance(means) >= _CHANCE / len(names):
            continue
        changing.append(name)
        unit = behind(units.get(name, ""))
        low, high = means[0][0], means[-1][0]
        values = [value for value, _ in means]
        if min(low, high) > min(values) or max(low, high) < max(values):
            reported.append(f"{name} moves between {min(values):.3g} and {max(values):.3g}{unit}")
        else:
            verb = "falls" if high < low else "rises"
            reported.append(f"{name} {verb} from {low:.3g} to {high:.3g}{unit}")
    if not changing:
        text = f"No parameter changes with the amplitude ({span.removeprefix('from ')}) beyond its interval."
        return text + _moving_resonance(compared), ()
    return (
        f"With amplitudes {span}, {'; '.join(reported)}. These changes exceed the confidence intervals, "
        "which indicates a nonlinear effect; 'rigsight diagnose' looks for it."
        + _no_single_inertia(compared, units, changing)
    ), tuple(changing)


def _no_single_inertia(
    compared: Sequence[tuple[float, Sequence[RecordIdentification]]],
    units: Mapping[str, str],
    changing: Sequence[str],
) -> str:
    """Return a warning if an inertia differs so much that units or scales must be wrong; it does not depend on amplitude."""
    records = [record for _, group in compared for record in group]
    for name in changing:
        if units.get(name) not in _INERTIAS:
            continue
        values = np.array([record.estimates[name][0] for record in records])
        if np.min(values) <= 0.0 or np.max(values) < _SAME_INERTIA * np.min(values):
            continue
        off = records[int(np.argmax(np.abs(np.log(values / np.median(values)))))]
        first = f", first of record {off.record.name}" if len(records) > 2 else ""
        ratio = np.max(values) / np.min(values)
        return (
            f" But {name} differs by a factor of {ratio:.3g}, which is implausible for an inertia: check units and scales of "
            f"input and output{first}."
        )
    return ""


def _moving_resonance(compared: Sequence[tuple[float, Sequence[RecordIdentification]]]) -> str:
    """Return a note if the resonance moves although the intervals, wide if the model does not fit, show no change."""
    found = [r.resonance for _, group in compared for r in group if r.resonance is not None]
    if len(found) < 2 or max(found) <= _MOVED * min(found):
        return ""
    return (
        f" However, the resonance is between {min(found):.3g} and {max(found):.3g} rad/s: the intervals are too wide to show a "
        f"change, but a nonlinear effect is likely. 'rigsight diagnose' looks for it."
    )


def _why_not(records: Sequence[RecordIdentification]) -> str:
    """Say why no two records can be compared."""
    if any(len(_by_amplitude(alike)) > 1 for alike in _alike(records)):
        reason = "Parameters were found at only one amplitude of the same inputs in the same kind of record"
        remedy = "Record others for longer, or over a wider band."
    elif len({tuple(path.source for path in found.paths) for found in records}) > 1:
        reason = "No two records drive the same inputs at different amplitudes"
        remedy = "Record one of them at another amplitude."
    elif len(_by_amplitude(records)) > 1:
        reason = "No two records of the same kind have different amplitudes"
        remedy = "Record one of them at another amplitude."
    else:
        reason, remedy = "The records have only one amplitude", "Record another amplitude."
    return f"{reason}, so they cannot show whether the parameters change with it. {remedy}"


def _comparable(records: Sequence[RecordIdentification]) -> list[tuple[float, list[RecordIdentification]]]:
    """Return the amplitudes in increasing order with their records, for the kind of records with the most amplitudes."""
    grouped = [_by_amplitude([r for r in alike if _has_numbers(r)]) for alike in _alike(records)]
    return max(grouped, key=len, default=[])


def _alike(records: Sequence[RecordIdentification]) -> list[list[RecordIdentification]]:
    """Return the records that differ in nothing but amplitude together."""
    return [
        [r for r in records if _driven_alike(r) == alike]
        for alike in dict.fromkeys(map(_driven_alike, records))
    ]


def _by_amplitude(records: Sequence[RecordIdentification]) -> list[tuple[float, list[RecordIdentification]]]:
    """Return the amplitudes in increasing order with their records."""
    groups: list[tuple[float, list[RecordIdentification]]] = []
    for found in sorted(records, key=lambda r: r.amplitude):
        if groups and found.amplitude <= (1.0 + _SAME_AMPLITUDE) * groups[-1][0]:
            groups[-1][1].append(found)
        else:
            groups.append((found.amplitude, [found]))
    return groups


def _numbers(found: RecordIdentification) -> list[PhysicalEstimates | None]:
    """Return the parameters of the paths of a record; where no path gives any, those of its own fit."""
    of_paths = [path.physical for path in found.paths]
    return [*of_paths, None if any(own is not None for own in of_paths) else found.own]


def _determined(found: PhysicalEstimates) -> list[str]:
    return [name for name in found.names if np.isfinite(found.standard_errors[name])]


def _driven_alike(found: RecordIdentification) -> tuple[str, ...]:
    """Return the properties that two records must share to be compared: kind, signal of the amplitude, and signal paths."""
    return (found.record.kind, found.source, *(f"{path.source} -> {path.response}" for path in found.paths))


def _has_numbers(found: RecordIdentification) -> bool:
    return found.own is not None or (bool(found.paths) and found.motion.physical is not None)


def _mean(estimates: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the mean weighted by inverse variances, with its standard error."""
    values, errors = np.array(estimates).T
    if not np.all(np.isfinite(errors) & (errors > 0.0)):
        return float(np.mean(values)), float("inf")
    weights = errors**-2
    return float(weights @ values / weights.sum()), float(weights.sum() ** -0.5)


def _chance(means: Sequence[tuple[float, float]]) -> float:
    """Return the probability of an equal or larger scatter if the value is the same everywhere."""
    values, errors = np.array(means).T
    middle = _mean(means)[0]
    return float(chi2.sf(np.sum(((values - middle) / errors) ** 2), values.size - 1))


def measured_amplitude(record: Record, rig: Rig) -> tuple[float, str]:
    """Return the amplitude of a record in the unit of a signal, and that signal."""
    # This is the height of a step, or half the range of another input (the first that moves of several); for a free motion, half
    # the range of the first recorded output.
    inputs = [signal.name for signal in rig.inputs]
    outputs = [signal.name for signal in rig.outputs if signal.name in record]
    moving = [name for name in inputs if not is_constant(record[name])]
    if record.kind == "step" and not moving:
        # The record begins with the step.
        name = max(inputs, key=lambda own: abs(float(record[own][0])))
        return abs(float(record[name][0])), name
    name = (moving or outputs or inputs)[0]
    # Not the deviation from mean or median, which are not zero for a sweep that begins slowly.
    spanned = float(np.ptp(record[name]))
    return (spanned if moving and record.kind == "step" else 0.5 * spanned), name
