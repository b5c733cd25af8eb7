"""Shape of the force missing in an equation: a quick sparse regression on products of displacement and velocity.

No cause is named and nothing is simulated: the terms describe the missing force in these records, whatever causes it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.discover.motion import Motion, motion_of
from rigsight.discover.regression import Projected, alike, inclusion_probabilities, own_regression, rows_of
from rigsight.discover.terms.library import candidates, plain_terms
from rigsight.effects.symbols import derivative
from rigsight.errors import InputError
from rigsight.records.record import Record
from rigsight.rigs import Rig, evaluated

_TAKEN = 0.5
_SAME_COLUMN = 0.995
_WORTH_TELLING = 0.02
"""Share that a term must explain in addition to the others to be reported."""


@dataclass(frozen=True)
class ShapeTerm:
    """A term of the missing force."""

    # Its expression without the coefficient, in displacement x and velocity v about the rest position.
    term: str
    coefficient: float  # of the resisting force [unit]
    unit: str  # of the coefficient
    inclusion: float  # share of resampled data sets in which sparse regression selects the term


@dataclass(frozen=True)
class MissingForce:
    """The shape of the force that an equation lacks.

    Attributes
    ----------
    terms
        The terms that sparse regression selects, the most frequent first; may be empty.
    share
        Share of the mean square of the acceleration's (or force's) residual, including noise, that they explain.
    """

    terms: tuple[ShapeTerm, ...]
    share: float

    @property
    def sentence(self) -> str:
        """The finding in words."""
        if not self.terms:
            return "No product of displacement x and velocity v describes the missing force."
        reported = " and ".join(f"{t.coefficient:.3g} {t.term} ({t.unit})" for t in self.terms)
        return (
            f"In these records the missing force is about {reported}, with displacement x and velocity v; this explains "
            f"{self.share:.0%} of the error of the equations."
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        terms = [
            {"term": t.term, "coefficient": t.coefficient, "unit": t.unit, "inclusion": t.inclusion}
            for t in self.terms
        ]
        return {"terms": terms, "share": self.share, "sentence": self.sentence}


def missing_force(
    rig: Rig,
    records: Sequence[Record],
    values: Mapping[str, float],
    scales: Mapping[str, float],
    noise: float,
    rng: np.random.Generator,
    has_stiffness: bool = True,
) -> MissingForce:
    """Return the shape of the missing force, from a regression of the residual of the rig's own terms.

    Parameters
    ----------
    rig
        The rig.
    records
        Estimation records without the offsets of their sensors; constants of their own count only there.
    values
        Constants and re-identified parameters.
    scales
        Size of each base quantity.
    noise
        Noise floor of the first output.
    rng
        Source of the ensemble.
    has_stiffness
        False for an axis without a spring.

    Raises
    ------
    InputError
        If the records are too short for a regression, or if inertia, spring, damper or constant force differ between them.
    """
    motions = _driven_by_force(rig, records, values, noise)
    rows = rows_of(motions, scales["time"])
    projected = own_regression(rig, has_stiffness, motions, rows)
    library = candidates(plain_terms(rig, has_stiffness), motions, rows, projected, scales, rig.is_driven)
    library = [c for c in library if np.all(np.isfinite(c.column)) and np.any(c.column)]
    if not library:
        return MissingForce((), 0.0)
    columns = np.column_stack([candidate.column for candidate in library])
    # Of indistinguishable terms only the first is kept: the sine of a pendulum looks like a cubic term unless the swing is large.
    doubles = {second for _, second, _ in alike(projected, columns, _SAME_COLUMN)}
    library = [candidate for i, candidate in enumerate(library) if i not in doubles]
    columns = columns[:, [i for i in range(columns.shape[1]) if i not in doubles]]
    inclusion = inclusion_probabilities(projected, columns, rng)
    taken = [int(i) for i in np.argsort(-inclusion) if inclusion[i] >= _TAKEN]
    taken = _worth_telling(projected, columns, taken)
    if not taken:
        return MissingForce((), 0.0)
    coefficients, share = projected.explained(columns[:, taken])
    force = 1.0
    if rig.is_driven:
        # The force of the drive is known: its ratio to the acceleration gives the inertia for these terms.
        drive, *_ = projected.solved(columns[:, taken])[0]
        own = {**values, **records[0].constants}
        force = 1.0 / drive if drive > 0.0 else evaluated(rig.motion.inertia, own)
    terms = []
    for i, coefficient in zip(taken, coefficients, strict=True):
        (parameter,) = library[i].effect.parameters
        shape = derivative(library[i].effect.torque, sp.Symbol(parameter.name, real=True))
        unit = rig.with_unit(parameter).unit
        terms.append(ShapeTerm(_text(shape), float(coefficient) * force, unit, float(inclusion[i])))
    return MissingForce(tuple(terms), share)


def _driven_by_force(
    rig: Rig, records: Sequence[Record], values: Mapping[str, float], noise: float
) -> list[Motion]:
    """Return the motion of each record, with the force of the drive as its input: records may have different drive gains."""
    motion = rig.motion
    common = {**values, **records[0].constants}
    found = []
    for record in records:
        own = {**values, **record.constants}
        for part in (motion.inertia, motion.damping, motion.stiffness, motion.rest, motion.bias):
            # One regression with the same coefficients in all records would be wrong.
            if part is not None and evaluated(part, own) != evaluated(part, common):
                raise InputError(
                    f"The constants of record '{record.name}' change the coefficients of the motion."
                )
        found.append(motion_of(rig, record, own, noise))
        if rig.is_driven:
            found[-1] = replace(found[-1], u=evaluated(motion.drive_gain, own) * found[-1].u)
    return found


def _worth_telling(projected: Projected, columns: NDArray[np.float64], taken: Sequence[int]) -> list[int]:
    """Leave out terms, one by one, that explain hardly more than the others do."""
    kept = list(taken)
    while kept:
        share = projected.explained(columns[:, kept])[1]
        without = [projected.explained(columns[:, [i for i in kept if i != out]])[1] for out in kept]
        least = int(np.argmax(without))
        if share - without[least] >= _WORTH_TELLING:
            break
        del kept[least]
    return kept


def _text(shape: sp.Expr) -> str:
    return str(shape).replace("**", "^").replace("*", " ")
