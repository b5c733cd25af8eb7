"""Do sweeps and steps share one parameter set? One fit of all records, compared with fits of each kind alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from scipy.stats import chi2

from rigsight.errors import InputError
from rigsight.identify.fit.covariance import LEVEL, normal_interval
from rigsight.identify.fit.fit_data import FitResult
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.start.linear_start import linear_start
from rigsight.identify.start.scales import characteristic_scales
from rigsight.records.record import Record
from rigsight.simulate import Structure

_NOISE_ROUNDS = 3
_SETTLED = 0.02


@dataclass(frozen=True)
class KindFit:
    """The fit of one kind of records alone."""

    kind: str  # the name of its group
    fit: FitResult  # fit of the records of this kind alone
    # By parameter: this kind's value minus the joint one, in standard errors of this kind's; NaN if it is
    # undetermined.
    shift: dict[str, float]


@dataclass(frozen=True)
class JointFit:
    """One parameter set for records of several kinds."""

    fit: FitResult  # the fit of all records
    noise: dict[str, float]  # standard deviation by which residuals of each output were divided
    kinds: tuple[KindFit, ...]  # the fits of each kind alone
    # Probability of such differences between the kinds by chance, if one set fits all (chi-squared).
    probability: float

    def interval(self, name: str, level: float = LEVEL) -> tuple[float, float]:
        """Return the confidence interval of a fitted parameter of the joint set."""
        return normal_interval(self.fit.values[name], self.fit.standard_errors[name], level)


def fit_jointly(
    structure: Structure,
    records: Sequence[Record],
    constants: Mapping[str, float],
    known: Mapping[str, float],
    start: Mapping[str, float],
    output_noise: Mapping[str, float] | None = None,
    group_of: Callable[[Record], str] = attrgetter("origin"),
) -> JointFit:
    """Fit one parameter set to all records, with parameters held that are known, and one to each group for comparison."""
    # A start is required for parameters of effects; missing ones of the rig are estimated from the spectra. The noise of each
    # output is estimated from the joint fit's own residuals, repeatedly, unless it is given.
    groups = {
        name: [r for r in records if group_of(r) == name] for name in dict.fromkeys(map(group_of, records))
    }
    _check_moves(structure, records)
    begin = {**start, **constants, **known}
    if any(p.name not in begin for p in structure.rig.parameters):
        begin = {**linear_start(structure.rig, records, constants, known), **begin}
    begin = {**{p.name: p.default for p in structure.parameters if p.default is not None}, **begin}
    missing = [name for name in structure.names if name not in begin]
    if missing:
        raise InputError(
            f"Start values are missing for: {', '.join(missing)}. Give them as start, or as known to keep them."
        )
    fixed = {*known, *constants}
    free = tuple(p.name for p in structure.parameters if p.fitted and p.name not in fixed)
    scales = characteristic_scales(structure.rig, records, begin)
    noise = dict(output_noise) if output_noise is not None else _spread(structure, records)
    fit = GreyBoxFit(structure, records, scales, noise).fit(begin, free)
    if output_noise is None:
        for _ in range(_NOISE_ROUNDS):
            before, noise = noise, _residual_noise(structure, fit, noise)
            settled = all(abs(noise[name] / before[name] - 1.0) < _SETTLED for name in noise)
            fit = GreyBoxFit(structure, records, scales, noise).fit(fit.values, free, fit.initial_states)
            if settled:
                break
    kinds = []
    for kind, own in groups.items():
        alone = GreyBoxFit(structure, own, scales, noise).fit(fit.values, free)
        kinds.append(KindFit(kind, alone, _shift(alone, fit)))
    return JointFit(fit, noise, tuple(kinds), _same_set(kinds))


def _check_moves(structure: Structure, records: Sequence[Record]) -> None:
    # A free decay moves without an input; records without any motion were left out by the reader.
    for record, source in ((record, name) for record in records for name in structure.rig.moving_inputs):
        if np.ptp(record[source]) <= 1e-12 * np.max(np.abs(record[source])):
            raise InputError(
                f"Record '{record.name}': '{source}' never moves, so this {record.kind} contains no information. Leave the "
                f"record out."
            )


def _spread(structure: Structure, records: Sequence[Record]) -> dict[str, float]:
    names = [s.name for s in structure.rig.outputs if any(s.name in r for r in records)]
    return {
        name: max(0.01 * float(np.std(np.concatenate([r[name] for r in records if name in r]))), 1e-12)
        for name in names
    }


def _residual_noise(structure: Structure, fit: FitResult, noise: Mapping[str, float]) -> dict[str, float]:
    if not fit.residuals:
        return dict(noise)
    found = {}
    for i, signal in enumerate(structure.rig.outputs):
        if signal.name in noise:
            remainder = np.concatenate([residual[:, i] for residual in fit.residuals])
            found[signal.name] = max(float(np.sqrt(np.nanmean(remainder**2))), 1e-6 * noise[signal.name])
    return found


def _shift(alone: FitResult, joint: FitResult) -> dict[str, float]:
    errors = {n: e if 0.0 < e < np.inf else float("nan") for n, e in alone.standard_errors.items()}
    return {name: (alone.values[name] - joint.values[name]) / errors[name] for name in joint.free}


def _same_set(kinds: Sequence[KindFit]) -> float:
    """Return the probability of such differences if all kinds, which are independent, have one set."""
    # Parameters that are undetermined for one of the kinds (alone or in combination with others) are not included.
    free = kinds[0].fit.free
    usable = [
        i
        for i, name in enumerate(free)
        if all(np.isfinite(k.fit.covariance[i, i]) and np.isfinite(k.shift[name]) for k in kinds)
    ]
    if len(kinds) < 2 or not usable or not all(k.fit.residuals for k in kinds):
        return float("nan")
    picked = np.ix_(usable, usable)
    values = [np.array([k.fit.values[free[i]] for i in usable]) for k in kinds]
    size = np.sqrt(np.mean([np.diag(k.fit.covariance[picked]) for k in kinds], axis=0))
    weights = [np.linalg.pinv(k.fit.covariance[picked] / np.outer(size, size), hermitian=True) for k in kinds]
    mean = np.linalg.solve(sum(weights), sum(w @ (v / size) for w, v in zip(weights, values, strict=True)))
    distance = sum(
        float((v / size - mean) @ w @ (v / size - mean)) for w, v in zip(weights, values, strict=True)
    )
    return float(chi2.sf(distance, len(usable) * (len(kinds) - 1)))
