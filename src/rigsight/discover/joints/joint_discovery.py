"""The whole discovery on a rig of several joints: records and a rig -> missing force per joint, its law, refitted equations.

Linearized responses propose joint and law. The rig with this law is refitted by output error, and the equations are selected by
free runs on held-out records.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.discover.assembly import coefficients_of, discovery_of, still_missing
from rigsight.discover.joints.joint_force import JointForce, missing_forces, not_contradicted
from rigsight.discover.joints.joint_law import LawTerm
from rigsight.discover.regression import STRONG, RegressionData, information_criterion, split
from rigsight.discover.result import Alternative, Coefficient, Discovery, Run, Term
from rigsight.discover.selection import independent_samples
from rigsight.effects import effect_named, placed
from rigsight.effects.placed import kind_of
from rigsight.errors import SimulationError
from rigsight.identify import (
    FitResult,
    GreyBoxFit,
    IdleThreads,
    characteristic_scales,
    linear_start,
    swallowed_by_offsets,
    without_offsets,
)
from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig
from rigsight.simulate import compose

_EVALUATIONS = 100
_NO_WORSE = 1.05
"""Factor of the held-out error up to which an equation with fewer terms is shortened further."""
_VAGUE = 3.0
"""Ratio to its standard error below which a coefficient cannot be distinguished from zero."""


@dataclass(frozen=True, eq=False)
class _Polished:
    """The rig with some terms, fitted and scored; `residuals` are held-out errors, shape (n_samples, n_outputs) per record."""

    terms: tuple[LawTerm, ...]
    fit: FitResult
    residuals: tuple[Floats, ...]
    error_over_noise: float


def discover_at_joints(
    data: RegressionData, seed: int = 0, progress: Callable[[str], None] | None = None, n_jobs: int = 1
) -> Discovery:
    """Discover which force is missing at which joint, and complete the rig's equations with its law."""
    say = progress or (lambda _: None)
    polisher = _Polisher(data, IdleThreads(n_jobs))
    alone = polisher.polished((), polisher.start)
    if not math.isfinite(alone.fit.cost):
        raise SimulationError(
            f"The equations of {data.rig.name} cannot be simulated near these records: {alone.fit.message}"
        )
    say("re-identified")
    known = {**data.campaign.constants, **alone.fit.values}
    centered = without_offsets(polisher.estimation, alone.fit)
    try:
        joints = missing_forces(data.rig, centered, known, data.noise, np.random.default_rng(seed))
    except np.linalg.LinAlgError as error:
        raise SimulationError(
            f"The missing forces of {data.rig.name} cannot be found from its responses linearized about these records ({error})."
        ) from error
    say("missing forces")
    found = [alone]
    # The law of a joint that is ruled out is not refitted.
    for force in not_contradicted(joints):
        if force.law.terms:
            start = {**known, **force.parameters}
            found.append(polisher.polished(force.law.terms, start))
            say(", ".join(term.effect.name for term in force.law.terms))
    found += _shorter(polisher, min(found, key=lambda one: one.error_over_noise), say)
    return _assembled(data, polisher, found, joints)


def _shorter(polisher: _Polisher, best: _Polished, say: Callable[[str], None]) -> list[_Polished]:
    """Polish equations with one term less, or with a special case in place of a term, until the error increases."""
    found: list[_Polished] = []
    while best.terms:
        values = {**best.fit.values}
        tried = [polisher.polished(terms, values) for terms in _simpler(best) if terms]
        found += tried
        say("fewer terms")
        good = [one for one in tried if one.error_over_noise <= _NO_WORSE * best.error_over_noise]
        if not good:
            break
        best = min(good, key=lambda one: one.error_over_noise)
    return found


def _simpler(one: _Polished) -> list[tuple[LawTerm, ...]]:
    fitted = [
        replace(term, values={**term.values, **one.fit.structure.values_of(term.effect, one.fit.values)})
        for term in one.terms
    ]
    found = [tuple(term for term in fitted if term is not out) for out in fitted]
    for term in fitted:
        for name in term.effect.parents:
            parent = placed(effect_named(kind_of(name)), str(term.effect.at))
            own = [p.name for p in parent.parameters]
            taken = any(other.effect.name == parent.name for other in fitted)
            if not taken and all(n in term.values for n in own):
                values, units = {n: term.values[n] for n in own}, {n: term.units[n] for n in own}
                found.append(
                    tuple(LawTerm(parent, values, {}, units) if other is term else other for other in fitted)
                )
    return found


class _Polisher:
    """Fits the rig with terms at its joints, and scores it on the held-out records."""

    def __init__(self, data: RegressionData, threads: IdleThreads) -> None:
        self.rig, self.noise, self._threads = data.rig, data.noise, threads
        self._free = {p.name for p in data.rig.parameters if p.fitted} - set(data.held)
        self.estimation, self.held_out, self.how = split(data)
        self.start = {
            **data.campaign.constants,
            **linear_start(data.rig, self.estimation, data.campaign.constants, data.held),
        }
        self._scales = characteristic_scales(data.rig, self.estimation, self.start)
        structure, asked = compose(data.rig), sorted(self._free)
        self._free -= set(
            swallowed_by_offsets(structure, self.estimation, self._scales, self.noise, self.start, asked)
        )

    def polished(self, terms: Sequence[LawTerm], values: Mapping[str, float]) -> _Polished:
        structure = compose(self.rig, [term.effect for term in terms])
        start, free = dict(values), set(self._free)
        for term in terms:
            for parameter in term.effect.parameters:
                name = structure.parameter_name(term.effect, parameter.name)
                value = term.values.get(parameter.name, parameter.default)
                assert value is not None
                start[name] = value
                free |= {name} if parameter.fitted else set()
        names = [name for name in structure.names if name in free]
        problem = GreyBoxFit(structure, self.estimation, self._scales, self.noise, threads=self._threads)
        fit = problem.fit(start, names, max_evaluations=_EVALUATIONS)
        if not math.isfinite(fit.cost):
            return _Polished(tuple(terms), fit, (), float("inf"))
        score = GreyBoxFit(structure, self.held_out, self._scales, self.noise, threads=self._threads).fit(
            fit.values, []
        )
        error_over_noise = score.weighted_rms if score.residuals else float("inf")
        return _Polished(tuple(terms), fit, score.residuals, error_over_noise)


def _assembled(
    data: RegressionData, polisher: _Polisher, found: Sequence[_Polished], joints: tuple[JointForce, ...]
) -> Discovery:
    rig, held_out = data.rig, polisher.held_out
    finest = min(found, key=lambda one: one.error_over_noise)
    if not math.isfinite(finest.error_over_noise):
        raise SimulationError("The refitted equations cannot be simulated on the held-out records.")
    independent = _independent(rig, finest)

    def criterion(one: _Polished) -> float:
        if not math.isfinite(one.error_over_noise):
            return float("inf")
        return information_criterion(one.error_over_noise**2, len(one.fit.free), independent)

    ordered = sorted(found, key=criterion)
    close = [one for one in ordered if criterion(one) <= criterion(ordered[0]) + STRONG]
    chosen = min(close, key=lambda one: (len(one.fit.free), criterion(one)))
    # The joints of the chosen equation come first, whatever the ranking by linearized responses.
    own_joints = {str(term.effect.at) for term in chosen.terms}
    joints = tuple(sorted(joints, key=lambda force: force.joint not in own_joints))
    coefficients = coefficients_of(chosen.fit)
    nrmse, floor = _relative(rig, data.noise, held_out, chosen)
    return discovery_of(
        data,
        chosen.fit,
        (polisher.estimation, held_out),
        method="discrepancy",
        form="linearized responses",
        terms=_terms(chosen, joints, coefficients),
        alternatives=tuple(
            Alternative(
                tuple(term.effect.name for term in one.terms),
                len(one.fit.free),
                one.error_over_noise,
                criterion(one) - len(one.fit.free) * (math.log(independent) - 2.0),
                criterion(one),
            )
            for one in ordered
        ),
        force_equation={},
        held_out_error=chosen.error_over_noise,
        held_out_nrmse=nrmse,
        noise_floor=floor,
        independent=independent,
        runs=tuple(_runs(rig, held_out, chosen)),
        warnings=tuple(_warnings(polisher.how, chosen, ordered, joints, coefficients)),
        joints=joints,
    )


def _terms(
    chosen: _Polished, joints: Sequence[JointForce], coefficients: Mapping[str, Coefficient]
) -> tuple[Term, ...]:
    structure, found = chosen.fit.structure, []
    inclusion = {name: share for force in joints for name, share in force.law.inclusion.items()}
    for term in chosen.terms:
        effect = term.effect
        names = [structure.parameter_name(effect, p.name) for p in effect.parameters]
        own = {name: coefficients[name] for name in names if name in coefficients}
        vague = [n for n, c in own.items() if not c.std < abs(c.value) / _VAGUE]
        doubt = f"{' and '.join(vague)} cannot be distinguished from zero" if vague else ""
        found.append(
            Term(
                kind_of(effect.name),
                effect.summary,
                True,
                inclusion.get(effect.name, 0.0),
                own,
                doubt,
                str(effect.at),
            )
        )
    kept = {term.effect.name for term in chosen.terms}
    others = [
        (force.law.inclusion.get(term.effect.name, 0.0), term)
        for force in joints
        for term in force.law.terms
        if term.effect.name not in kept
    ]
    found += [
        Term(kind_of(t.effect.name), t.effect.summary, False, share, {}, where=str(t.effect.at))
        for share, t in others
    ]
    return tuple(found)


def _independent(rig: Rig, one: _Polished) -> float:
    """Return the number of independent samples in the held-out errors of all sensors."""
    return sum(
        independent_samples(shown)
        for remainder in one.residuals
        for i in range(len(rig.outputs))
        if (shown := remainder[np.isfinite(remainder[:, i]), i]).size > 1
    )


def _relative(
    rig: Rig, noise: Mapping[str, float], held_out: Sequence[Record], chosen: _Polished
) -> tuple[float, float]:
    """Return held-out error and noise floor relative to the standard deviation of each sensor's readings, RMS over sensors."""
    errors, floors = [], []
    for i, signal in enumerate(rig.outputs):
        shown = [record[signal.name] for record in held_out if signal.name in record]
        if not shown:
            continue
        spread = float(np.std(np.concatenate(shown))) or 1.0
        remainder = np.concatenate([residual[:, i] for residual in chosen.residuals])
        errors.append(float(np.nanmean(remainder**2)) / spread**2)
        floors.append((noise[signal.name] / spread) ** 2)
    return float(np.sqrt(np.mean(errors))), float(np.sqrt(np.mean(floors)))


def _runs(rig: Rig, held_out: Sequence[Record], chosen: _Polished) -> list[Run]:
    """Return the free runs of the completed model on the held-out records, one for each sensor."""
    return [
        Run(r.name, r.role, r.t, r[signal.name], r[signal.name] - remainder[:, i], signal.name, signal.unit)
        for r, remainder in zip(held_out, chosen.residuals, strict=True)
        for i, signal in enumerate(rig.outputs)
        if signal.name in r
    ]


def _warnings(
    how: str,
    chosen: _Polished,
    ordered: Sequence[_Polished],
    joints: Sequence[JointForce],
    coefficients: Mapping[str, Coefficient],
) -> list[str]:
    """Return the warnings for the user, one sentence each."""
    found = [how] if how else []
    first, agreeing = joints[0], not_contradicted(joints)
    ruled_out = [force.joint for force in joints if force not in agreeing]
    if ruled_out:
        found.append(
            f"No force at {' or '.join(ruled_out)} alone explains the readings of all sensors; a force at {first.joint} explains "
            f"them up to {first.error_over_noise:.2g} noise floors."
        )
    rivals = [
        one
        for one in ordered
        if one is not chosen and one.error_over_noise <= chosen.error_over_noise and one.terms
    ]
    if rivals:
        listed = "; ".join(", ".join(term.effect.name for term in one.terms) for one in rivals)
        found.append(
            f"{listed} does not increase the held-out error, but does not lower it significantly either."
        )
    found += still_missing(chosen.error_over_noise)
    unknown = [name for name, c in coefficients.items() if not math.isfinite(c.std)]
    if unknown:
        found.append(f"These records do not determine {', '.join(unknown)}.")
    return found
