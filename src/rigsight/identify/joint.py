"""Do sweeps and steps share one parameter set? One fit of all records, compared with fits of each kind alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from rigsight.errors import InputError
from rigsight.identify.fit.covariance import LEVEL
from rigsight.identify.fit.fit_data import FitResult
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.start.linear_start import linear_start
from rigsight.identify.start.scales import characteristic_scales
from rigsight.records.record import Record
from rigsight.simulate import Structure

_NOISE_ROUNDS = 3
_SETTLED = 0.02
_DIFFERENT = 0.01
"""Probability of a difference by chance, below which two parameter sets count as different."""


@dataclass(frozen=True)
class KindFit:
    """The fit of one kind of records alone."""

    kind: str  # ``"sweep"``, ``"step"``, ..., or the name of its group
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
    statement: str  # the answer in words

    def interval(self, name: str, level: float = LEVEL) -> tuple[float, float]:
        """Return the confidence interval of a fitted parameter of the joint set."""
        width = float(norm.ppf(0.5 + 0.5 * level)) * self.fit.standard_errors[name]
        return self.fit.values[name] - width, self.fit.values[name] + width


def fit_jointly(
    structure: Structure,
    records: Sequence[Record],
    constants: Mapping[str, float],
    known: Mapping[str, float] | None = None,
    start: Mapping[str, float] | None = None,
    output_noise: Mapping[str, float] | None = None,
    group_of: Callable[[Record], str] | None = None,
) -> JointFit:
    """Fit one parameter set to sweeps and steps together, and one to each kind for comparison.

    Parameters
    ----------
    structure
        Rig and effects.
    records
        Records of at least two kinds (``Record.kind``).
    constants
        The rig's constants by name.
    known
        Parameters that are held at their value.
    start
        Start values, required for parameters of effects; missing ones of the rig are estimated from the spectra.
    output_noise
        Standard deviation of the residuals of each output. Default: estimated from the joint fit's own residuals, repeatedly.
    group_of
        Name of the group in which a record is compared, instead of its kind; a single group is then allowed, without comparison.

    Raises
    ------
    InputError
        If all records are of one kind, a motion that an input prescribes never moves, or an effect's start value is missing.
    """
    label = group_of or (lambda record: record.kind)
    groups = {name: [r for r in records if label(r) == name] for name in dict.fromkeys(map(label, records))}
    if group_of is None and len(groups) < 2:
        found = f"all {len(records)} are of kind '{next(iter(groups))}'" if groups else "there are none"
        raise InputError(
            f"A joint fit compares records of different kinds, and {found}. Add steps to sweeps or sweeps to steps (Record.kind) "
            "or use GreyBoxFit for one kind."
        )
    _check_moves(structure, records)
    held = dict(known or {})
    begin = {**dict(start or {}), **constants, **held}
    if any(p.name not in begin for p in structure.rig.parameters):
        begin = {**linear_start(structure.rig, records, constants, held), **begin}
    begin = {**{p.name: p.default for p in structure.parameters if p.default is not None}, **begin}
    missing = [name for name in structure.names if name not in begin]
    if missing:
        raise InputError(
            f"Start values are missing for: {', '.join(missing)}. Give them as start, or as known to keep them."
        )
    fixed = {*held, *constants}
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
    probability, differing = _same_set(kinds)
    compared = "Records" if group_of else " and ".join(f"{k.kind}s" for k in kinds)
    statement = _statement(compared, probability, differing, fit)
    return JointFit(fit, noise, tuple(kinds), probability, statement)


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


def _same_set(kinds: Sequence[KindFit]) -> tuple[float, tuple[str, ...]]:
    """Test whether all kinds have one set, by deviations from the weighted mean; records of different kinds are independent."""
    # Parameters that are undetermined for one of the kinds (alone or in combination with others) are not included.
    free = kinds[0].fit.free
    usable = [
        i
        for i, name in enumerate(free)
        if all(np.isfinite(k.fit.covariance[i, i]) and np.isfinite(k.shift[name]) for k in kinds)
    ]
    if len(kinds) < 2 or not usable or not all(k.fit.residuals for k in kinds):
        return float("nan"), ()
    picked = np.ix_(usable, usable)
    values = [np.array([k.fit.values[free[i]] for i in usable]) for k in kinds]
    size = np.sqrt(np.mean([np.diag(k.fit.covariance[picked]) for k in kinds], axis=0))
    weights = [np.linalg.pinv(k.fit.covariance[picked] / np.outer(size, size), hermitian=True) for k in kinds]
    mean = np.linalg.solve(sum(weights), sum(w @ (v / size) for w, v in zip(weights, values, strict=True)))
    distance = sum(
        float((v / size - mean) @ w @ (v / size - mean)) for w, v in zip(weights, values, strict=True)
    )
    degrees = len(usable) * (len(kinds) - 1)
    differing = []
    for j, i in enumerate(usable):
        spread = [v[j] for v in values]
        error = float(np.sqrt(sum(k.fit.covariance[i, i] for k in kinds)))
        if max(spread) - min(spread) > float(norm.ppf(1.0 - _DIFFERENT / 2.0)) * error:
            differing.append(free[i])
    return float(chi2.sf(distance, degrees)), tuple(differing)


def _statement(names: str, probability: float, differing: Sequence[str], fit: FitResult) -> str:
    if not np.isfinite(probability):
        return f"{names} have no common parameter that each of them determines; nothing can be compared."
    if not fit.success:
        return f"The joint fit did not converge: {fit.message}"
    if probability >= _DIFFERENT:
        return f"One parameter set fits {names}: differences this large arise by chance with probability {probability:.2g}."
    which = f" They differ in {', '.join(differing)}." if differing else ""
    return (
        f"{names} have different parameters under this model (probability of chance {probability:.1g}).{which} The model lacks "
        f"an effect that depends on amplitude or frequency."
    )
