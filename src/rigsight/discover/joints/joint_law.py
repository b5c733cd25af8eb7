"""Law of the missing force at a joint: sparse regression on terms of the motion of the joint, weighted by the sensor noise.

The part of the force that no term explains remains an unknown force, whose intensity competes with the terms. The law is selected
by its likelihood, which is comparable between joints and so also shows at which joint the law acts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigsight.discover.joints.joint_motion import JointMotion
from rigsight.discover.joints.sensor_regression import SensorRegression, sensor_regressions
from rigsight.discover.motion import Motion
from rigsight.discover.regression import STRONG, alike, inclusion_probabilities, sparse_path
from rigsight.discover.terms.library import (
    Candidate,
    TermSignals,
    along,
    mixed,
    offered_effects,
    term_signals,
)
from rigsight.discover.terms.monomials import LINEAR
from rigsight.effects import Effect, Place, placed
from rigsight.effects.placed import kind_of
from rigsight.records.record import Floats
from rigsight.rigs import Joint, Rig, evaluated

_MOST_TERMS = 4
_SAME_COLUMN = 1.0 - 1e-7
"""Correlation above which terms cannot be distinguished by a record of this length; otherwise the likelihood decides."""
_SAME_STIFFNESS = 0.5
"""Relative difference within which a coefficient counts as the stiffness of the spring, which play does not change."""
_WORTH = 0.05
"""Share of the law's force (RMS) that each of its terms must have: a smaller one only corrects errors of the other terms."""
_COMPETING = 6
"""Number of terms that compete in an ensemble."""
_LOOKED_AT = 2
"""Number of intensities of the remaining unknown force for which laws of several terms are searched."""


@dataclass(frozen=True, eq=False)
class LawTerm:
    """A term of a law."""

    effect: Effect  # the term, placed at its joint
    values: Mapping[str, float]  # coefficients, and nonlinear parameters inside the term, by their own names
    std: Mapping[str, float]  # standard error of each coefficient
    units: Mapping[str, str]  # of `values`

    @property
    def text(self) -> str:
        """The term in words, with its parameter values."""
        kind = kind_of(self.effect.name).replace("_", " ")
        numbers = ", ".join(f"{name} = {value:.3g} {self.units[name]}" for name, value in self.values.items())
        if self.effect.torque is None:
            return f"that of {kind} ({numbers})"
        shape = str(self.effect.torque).replace("**", "^").replace("*", " ")
        return f"{shape} ({kind}: {numbers})"

    def to_json(self) -> dict[str, Any]:
        """Return the entry of a file; nonlinear and undetermined parameters have no standard error there."""
        return {
            "name": kind_of(self.effect.name),
            "where": self.effect.at,
            "coefficients": {
                name: {"value": value, "std": self.std.get(name), "unit": self.units[name]}
                for name, value in self.values.items()
            },
        }


@dataclass(frozen=True, eq=False)
class RegressedLaw:
    """A law, with the rig's parameters estimated with it."""

    terms: tuple[LawTerm, ...]  # the most significant first; may be empty
    parameters: Mapping[str, float]  # the rig's own, estimated with the law
    criterion: float  # bayesian information criterion; comparable between joints
    decade: float  # common logarithm of the intensity of the remaining unknown force


def joint_effects(rig: Rig, joint: Joint) -> list[Effect]:
    """Return the effects that can be terms of a regression at a joint, placed there."""
    found = [
        e for e in offered_effects(rig, joint.stiffness != 0) if e.place is Place.DYNAMICS and not e.states
    ]
    declared = {
        "monomial_x0_v0": joint.force != 0 or joint.rest != 0,
        "monomial_x1_v0": joint.stiffness != 0,
        "monomial_x0_v1": joint.damping != 0,
    }
    found += [effect for effect in LINEAR if not declared[effect.name]]
    return [placed(effect, joint.name) for effect in found]


def force_along(term: LawTerm, found: JointMotion, index: int, parameters: Mapping[str, float]) -> Floats:
    """Return the resisting force of a term along the motion of its joint in a record, shape (n_samples,)."""
    motion = _motion(found, index)
    if term.effect.torque is not None:
        return along(term.effect.torque, term.values, motion)
    return evaluated(found.joint.stiffness, parameters) * (
        along(term.effect.deflection, term.values, motion) - motion.x
    )


def _motion(found: JointMotion, index: int) -> Motion:
    x, v = found.displacement[index], found.velocity[index]
    return Motion(found.records[index], x, v, np.zeros_like(x), np.zeros_like(x), x)


def regressed_laws(
    found: Sequence[JointMotion], noise: Floats, scales: Sequence[Mapping[str, float]]
) -> list[RegressedLaw]:
    """Return, for each joint, the law with the fewest terms that the sensors do not distinguish from the most likely one."""
    records = found[0].records
    offered = [_offered(one, sizes) for one, sizes in zip(found, scales, strict=True)]
    signals = [_columns(own, len(records)) for own in offered]
    regressions = sensor_regressions([one.followed for one in found], records, noise, signals)
    return [
        _best_law(of_joint, own, np.concatenate(course), one)
        for of_joint, own, course, one in zip(regressions, offered, signals, found, strict=True)
    ]


def inclusion(
    found: JointMotion,
    noise: Floats,
    scales: Mapping[str, float],
    law: RegressedLaw,
    rng: np.random.Generator,
) -> dict[str, float]:
    """Return inclusion probabilities: the shares of resampled data sets in which terms are selected, by name of the effect."""
    offered = _offered(found, scales)
    signals = _columns(offered, len(found.records))
    ((*regressions,),) = sensor_regressions([found.followed], found.records, noise, [signals])
    regression = min(regressions, key=lambda one: abs(one.decade - law.decade))
    library = _library(regression, offered, np.concatenate(signals), found)
    own = {term.effect.name for term in law.terms}
    shares = {c.name: regression.projected.explained(c.column[:, None])[1] for c in library.terms}
    ranked = sorted(library.terms, key=lambda c: (c.name not in own, -shares[c.name]))[:_COMPETING]
    if not ranked:
        return {}
    columns = np.column_stack([candidate.column for candidate in ranked])
    taken = inclusion_probabilities(regression.projected, columns, rng)
    return {candidate.name: float(share) for candidate, share in zip(ranked, taken, strict=True)}


def _offered(found: JointMotion, scales: Mapping[str, float]) -> list[TermSignals]:
    rig = found.followed.equations.structure.rig
    motions = [_motion(found, index) for index in range(len(found.records))]
    offered = [s for effect in joint_effects(rig, found.joint) for s in term_signals(effect, motions, scales)]
    return [s for s in offered if all(np.all(np.isfinite(part)) for own in s.parts for part in own)]


def _columns(offered: Sequence[TermSignals], n_records: int) -> list[Floats]:
    """Return the parts of all terms along each record, shape (n_samples, n_parts) each."""
    return [np.column_stack([part for s in offered for part in s.parts[i]]) for i in range(n_records)]


@dataclass(frozen=True, eq=False)
class _Library:
    """The terms of a joint at their best nonlinear parameters, for one intensity of the remaining unknown force.

    `forces` are the terms along all records as forces, shape (n_samples, n_terms).
    """

    regression: SensorRegression
    terms: tuple[Candidate, ...]
    forces: Floats
    found: JointMotion

    @property
    def columns(self) -> Floats:
        return np.column_stack([term.column for term in self.terms])

    def law(self, support: tuple[int, ...]) -> RegressedLaw | None:
        return _law(
            self.regression, [self.terms[i] for i in support], self.forces[:, list(support)], self.found
        )


def _best_law(
    regressions: Sequence[SensorRegression],
    offered: Sequence[TermSignals],
    course: Floats,
    found: JointMotion,
) -> RegressedLaw:
    libraries = [_library(regression, offered, course, found) for regression in regressions]
    short = [
        [
            law
            for support in ((), *((i,) for i in range(len(own.terms))))
            if (law := own.law(support)) is not None
        ]
        for own in libraries
    ]
    laws = [law for of_library in short for law in of_library]
    # Longer laws are searched at the intensities at which the short ones are most likely.
    order = np.argsort([min(law.criterion for law in of_library) for of_library in short])
    for own in (libraries[int(i)] for i in order[:_LOOKED_AT]):
        if own.terms:
            supports = sparse_path(own.regression.projected, own.columns)
            longer = [own.law(support) for support in supports if 1 < len(support) <= _MOST_TERMS]
            laws += [law for law in longer if law is not None]
    lowest = min(law.criterion for law in laws)
    close = [law for law in laws if law.criterion <= lowest + STRONG]
    return min(close, key=lambda law: (len(law.terms), law.criterion))


def _library(
    regression: SensorRegression, offered: Sequence[TermSignals], course: Floats, found: JointMotion
) -> _Library:
    best: dict[str, tuple[Candidate, float, Floats]] = {}
    first = 0
    for signals in offered:
        own = slice(first, first + len(signals.parts[0]))
        first = own.stop
        parts = regression.columns[:, own]
        if np.any(np.all(parts == 0.0, axis=0)):
            continue
        candidate, share = mixed(signals, parts, regression.projected)
        if candidate.name not in best or share > best[candidate.name][1]:
            mixture = [candidate.linear[name] for name in signals.names if name in candidate.linear] or [1.0]
            best[candidate.name] = candidate, share, course[:, own][:, : len(mixture)] @ np.array(mixture)
    kept = list(best.values())
    if kept:
        columns = np.column_stack([candidate.column for candidate, _, _ in kept])
        doubles = {j for _, j, _ in alike(regression.projected, columns, _SAME_COLUMN)}
        kept = [term for i, term in enumerate(kept) if i not in doubles]
    forces = np.column_stack([force for _, _, force in kept]) if kept else np.zeros((len(course), 0))
    return _Library(regression, tuple(candidate for candidate, _, _ in kept), forces, found)


def _law(
    regression: SensorRegression, chosen: Sequence[Candidate], forces: Floats, found: JointMotion
) -> RegressedLaw | None:
    """Return the law of given terms; None if a term would drive the motion, does not fit the spring, or is negligible."""
    followed, rig = found.followed, found.followed.equations.structure.rig
    projected = regression.projected
    base = projected.base
    matrix = np.column_stack([base, *(c.column for c in chosen)])
    size = np.linalg.norm(matrix, axis=0)
    solution, *_ = np.linalg.lstsq(matrix / size, projected.target, rcond=1e-12)
    remainder = projected.target - (matrix / size) @ solution
    inverse = np.linalg.pinv((matrix / size).T @ (matrix / size), rcond=1e-14, hermitian=True)
    # A residual above the noise makes the standard errors larger than the noise alone would.
    excess = max(1.0, float(remainder @ remainder) / projected.independent)
    errors = np.sqrt(np.diag(inverse) * excess) / size
    solution = solution / size
    coefficients = solution[base.shape[1] :]
    size_of_terms = np.sqrt(np.mean((forces * coefficients) ** 2, axis=0))
    if np.any(size_of_terms < _WORTH * np.sqrt(np.mean((forces @ coefficients) ** 2))):
        return None
    parameters = dict(followed.values)
    for name, change in zip(regression.fitted, solution, strict=False):
        parameters[name] += float(change)
    stiffness = evaluated(found.joint.stiffness, parameters)
    terms = []
    for candidate, value, error in zip(chosen, coefficients, errors[base.shape[1] :], strict=True):
        named = {p.name: p for p in candidate.effect.parameters}
        values = {**candidate.inner, **{n: share * float(value) for n, share in candidate.linear.items()}}
        std = {n: abs(share) * float(error) for n, share in candidate.linear.items()}
        if any(values[name] < named[name].lower for name in candidate.linear):
            return None
        # An effect between motion and spring replaces the stiffness of the spring.
        if not candidate.linear and abs(value - stiffness) > _SAME_STIFFNESS * abs(stiffness):
            return None
        units = {n: rig.with_unit(p, found.joint.name).unit for n, p in named.items()}
        terms.append((float(abs(value) / error), LawTerm(candidate.effect, values, std, units)))
    terms.sort(key=lambda pair: -pair[0])
    n_numbers = sum(len(c.inner) + max(1, len(c.linear)) for c in chosen)
    return RegressedLaw(
        tuple(term for _, term in terms),
        parameters,
        regression.criterion(float(remainder @ remainder), n_numbers),
        regression.decade,
    )
