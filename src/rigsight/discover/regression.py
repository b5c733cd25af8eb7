"""Which terms sparse regression selects, in which order, and how often: pysindy's optimizers on dimensionless columns.

The rig's own terms (its drive, its rest position and, in the discrepancy form, its damper and spring) are projected out first, so
that they never compete. Rows are stored as a triangular factor with the same normal equations and a few hundred times fewer rows.

References
----------
L. Boninsegna, F. Nueske and C. Clementi, J. Chem. Phys. 148 (2018) 241723, for stepwise sparse regression; U. Fasel et al.,
Proc. R. Soc. A 478 (2022) 20210904, for inclusion probabilities from ensembles.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from rigsight.campaign import Campaign
from rigsight.discover.motion import Motion, Rows
from rigsight.errors import InputError
from rigsight.identify import IdleThreads
from rigsight.records.record import Floats, Record
from rigsight.records.signals import is_constant
from rigsight.rigs import Rig

_WINDOW = 0.75
"""Width of a test function in natural periods: long enough to average the noise, short enough to resolve the motion."""
_MOST_POINTS = 20_000


N_ENSEMBLE = 40
N_BLOCKS = 40
"""Number of contiguous stretches of rows that an ensemble draws from; stretches because neighboring rows share their noise."""
_CLEARLY = 1.1
"""Factor by which a larger support must lower the residual: columns from a smoothed motion are not more accurate than this."""
STRONG = 10.0
"""Difference of the criterion that counts as decided (Kass and Raftery 1995: very strong evidence)."""
_TINY = 1e-10
_LEAST_SAMPLES = 200
_HELD_BACK = 0.3
_RIDGE = 1e-12


@dataclass(frozen=True, eq=False)
class Projected:
    """A regression with some columns projected out of the target and of all other columns."""

    base: Floats  # columns that are always included, shape (n_rows, n_base)
    target: Floats  # shape (n_rows,)
    independent: float  # number of independent rows; less than n_rows, because windows overlap

    @cached_property
    def _directions(self) -> Floats:
        size = np.linalg.norm(self.base, axis=0)
        return np.linalg.qr(self.base[:, size > 0.0] / size[size > 0.0])[0]

    @cached_property
    def rest(self) -> Floats:
        """The target without the part that the base columns explain."""
        return self.rest_of(self.target)

    def rest_of(self, columns: Floats) -> Floats:
        """Return columns without the part that the base columns explain."""
        return np.asarray(columns - self._directions @ (self._directions.T @ columns))

    def explained(self, columns: Floats) -> tuple[Floats, float]:
        """Return coefficients of further columns and the share that they explain of the residual of the base."""
        remainder, added = self.rest, self.rest_of(columns)
        size = np.linalg.norm(added, axis=0)
        if np.any(size <= _TINY * np.linalg.norm(columns, axis=0)):
            return np.zeros(columns.shape[1]), 0.0
        solution = np.linalg.lstsq(added / size, remainder, rcond=1e-10)[0]
        rest = remainder - (added / size) @ solution
        return solution / size, float(1.0 - (rest @ rest) / (remainder @ remainder))

    def solved(self, columns: Floats) -> tuple[Floats, float]:
        """Return coefficients of base and further columns, shape (n_base + n_columns,), and the RMS of the residual."""
        matrix = np.column_stack([self.base, columns])
        size = np.linalg.norm(matrix, axis=0) + 1e-300
        solution = np.linalg.lstsq(matrix / size, self.target, rcond=1e-12)[0]
        rest = self.target - (matrix / size) @ solution
        return solution / size, float(np.sqrt(np.mean(rest**2)))


def sparse_path(projected: Projected, columns: Floats) -> list[tuple[int, ...]]:
    """Return supports of every size, smallest first: those that remain when pysindy's SSR drops term after term.

    The supports of FROLS, which adds terms instead, are included; the two differ if columns are similar.
    """
    matrix, target = _compressed(projected.rest_of(columns), projected.rest)
    paths = [_path(matrix, target, shrinking) for shrinking in (True, False)]
    supports = {support for path in paths for support in path if support}
    return sorted(supports, key=lambda s: (len(s), s))


def inclusion_probabilities(projected: Projected, columns: Floats, rng: np.random.Generator) -> Floats:
    """Return the share of draws of random stretches of the rows in which each term is selected, shape (n_terms,).

    The support of a draw is the smallest whose residual hardly exceeds that of the support with the lowest Bayesian information
    criterion.
    """
    matrix, target = projected.rest_of(columns), projected.rest
    blocks = np.array_split(np.arange(target.size), min(N_BLOCKS, target.size))
    counts = np.zeros(columns.shape[1])
    for _ in range(N_ENSEMBLE):
        rows = np.concatenate([blocks[i] for i in rng.integers(len(blocks), size=len(blocks))])
        own_matrix, own_target = _compressed(matrix[rows], target[rows])
        supports = [(), *_path(own_matrix, own_target, shrinking=True)]
        remainder = np.array([_remainder(own_matrix, own_target, support) for support in supports])
        costs = [
            information_criterion(square / rows.size, len(support), projected.independent)
            for square, support in zip(remainder, supports, strict=True)
        ]
        enough = np.flatnonzero(remainder <= _CLEARLY**2 * remainder[int(np.argmin(costs))])[0]
        counts[list(supports[int(enough)])] += 1.0
    return np.asarray(counts / N_ENSEMBLE)


def information_criterion(mean_square: float, n_terms: int, independent: float) -> float:
    """Return the Bayesian information criterion with the number of independent residuals."""
    return float(independent * np.log(mean_square + 1e-300) + n_terms * np.log(independent))


def alike(projected: Projected, columns: Floats, threshold: float) -> list[tuple[int, int, float]]:
    """Return pairs of terms whose columns are similar after the rig's own terms are projected out, with their correlation."""
    rest = projected.rest_of(columns)
    size = np.linalg.norm(rest, axis=0)
    size[size == 0.0] = 1.0
    correlation = (rest / size).T @ (rest / size)
    return [
        (i, j, float(abs(correlation[i, j])))
        for i in range(rest.shape[1])
        for j in range(i + 1, rest.shape[1])
        if abs(correlation[i, j]) >= threshold
    ]


def _compressed(matrix: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Return a few rows with the same normal equations and the same sum of squares, with columns of unit length."""
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0.0] = 1.0
    factor = np.asarray(np.linalg.qr(np.column_stack([matrix / size, target]), mode="r"))
    return factor[:, :-1], factor[:, -1]


def _path(matrix: Floats, target: Floats, shrinking: bool) -> list[tuple[int, ...]]:
    """Return the supports that remain when SSR drops term after term, or those that FROLS reaches by adding terms."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from pysindy import FROLS, SSR
        from sklearn import config_context

        n = matrix.shape[1]
        optimizer = (
            SSR(alpha=_RIDGE, max_iter=max(1, n), criteria="model_residual", unbias=False)
            if shrinking
            else FROLS(alpha=_RIDGE, max_iter=min(6, n), unbias=False)
        )
        # Each of its hundreds of regressions of a few rows would be examined for longer than it takes.
        with config_context(skip_parameter_validation=True, assume_finite=True):
            optimizer.fit(matrix, target)
    return _supports(optimizer.history_)


def _supports(history: Sequence[Floats]) -> list[tuple[int, ...]]:
    supports = (tuple(int(i) for i in np.flatnonzero(np.ravel(coefficients))) for coefficients in history)
    return sorted({support for support in supports if support}, key=lambda s: (len(s), s))


def _remainder(matrix: Floats, target: Floats, support: tuple[int, ...]) -> float:
    if not support:
        return float(target @ target)
    chosen = matrix[:, list(support)]
    rest = target - chosen @ np.linalg.lstsq(chosen, target, rcond=1e-10)[0]
    return float(rest @ rest)


@dataclass(frozen=True)
class RegressionData:
    """A campaign, the noise floors of its sensors, and the records that are regressed."""

    campaign: Campaign
    noise: Mapping[str, float]  # floor of each output
    windows: tuple[Record, ...] | None = None  # sections of the records to be used, for a rig that drifts

    @property
    def rig(self) -> Rig:
        """The rig of the campaign."""
        return self.campaign.rig

    @property
    def records(self) -> tuple[Record, ...]:
        """Estimation and validation records, cut into windows if the rig drifts."""
        return self.campaign.records if self.windows is None else self.windows

    @property
    def has_stiffness(self) -> bool:
        """False for an axis that is given without a spring."""
        return self.campaign.absent_spring is None

    @property
    def held(self) -> dict[str, float]:
        """Parameters held at a value: one of those that a free motion determines only up to a common factor."""
        factor = self.campaign.open_factor
        return {} if factor is None else {factor.held: factor.value}


def split(data: RegressionData) -> tuple[tuple[Record, ...], tuple[Record, ...], str]:
    """Return the records to fit, those to score, and a sentence on the choice of the latter (empty for validation records)."""
    estimation = tuple(r for r in data.records if r.role == "estimation")
    validation = tuple(r for r in data.records if r.role == "validation")
    if not estimation:
        raise InputError('A discovery needs at least one record with role = "estimation".')
    for record in estimation:
        if record.n_samples < _LEAST_SAMPLES:
            raise InputError(
                f"Record '{record.name}' has {record.n_samples} samples; a discovery needs at least {_LEAST_SAMPLES} in each."
            )
    if validation:
        return estimation, validation, ""
    if len(estimation) > 1:
        middle = sorted(estimation, key=partial(strength, data.rig))[len(estimation) // 2]
        rest = tuple(record for record in estimation if record is not middle)
        return (
            rest,
            (middle,),
            f"There is no validation record; '{middle.name}' was set aside to select the terms.",
        )
    cut = int((1.0 - _HELD_BACK) * estimation[0].n_samples)
    return (
        (estimation[0].slice(0, cut),),
        (replace(estimation[0].slice(cut, None), name=f"{estimation[0].name} (end)"),),
        "There is a single record; its last part was set aside to select the terms, so no other amplitude is tested.",
    )


def strength(rig: Rig, record: Record) -> float:
    """Return the size of the inputs of a record, or of the outputs of a rig without inputs."""
    names = [signal.name for signal in rig.inputs or rig.outputs]
    return float(np.sqrt(sum(np.var(record[name]) for name in names if name in record)))


def rows_of(motions: Sequence[Motion], time: float, pointwise: bool = False) -> Rows:
    """Return the form of the rows: windows for a rig whose angular frequency is ``1 / time``, or single points."""
    if pointwise:
        return Rows(None, max(1, sum(motion.x.size for motion in motions) // _MOST_POINTS))
    return Rows(_WINDOW * 2.0 * np.pi * time)


def own_regression(rig: Rig, has_stiffness: bool, motions: Sequence[Motion], rows: Rows) -> Projected:
    """Return the regression of acceleration (or force, if the motion is prescribed) on the rig's own terms."""
    order = 2 if rig.is_driven else 0
    rests = all(is_constant(motion.u) for motion in motions)
    blocks, targets = [], []
    for motion in motions:
        velocity, displacement = rows.velocity(motion), rows.of(motion.x, motion.dt)
        one = np.ones_like(displacement)
        if not rig.is_driven:
            blocks.append(np.column_stack([velocity, displacement, one]))
            targets.append(rows.of(motion.measured, motion.dt))
            continue
        # A constant drive is part of the constant term; its column is kept as zeros, so that the others keep their positions.
        drive = np.zeros_like(one) if rests else rows.of(motion.u, motion.dt)
        own = (drive, -velocity, -displacement, one) if has_stiffness else (drive, -velocity, one)
        blocks.append(np.column_stack(own))
        targets.append(rows.acceleration(motion))
    independent = sum(
        target.size * rows.independent_share(order, motion.dt)
        for target, motion in zip(targets, motions, strict=True)
    )
    base = np.concatenate(blocks)
    if base.shape[0] <= base.shape[1]:
        longest = max(motion.x.size * motion.dt for motion in motions)
        raise InputError(
            f"The records are too short for a regression: the longest has {longest:.3g} s, and the equations are integrated over "
            f"windows of {rows.width:.3g} s. Add a longer record."
        )
    return Projected(base, np.concatenate(targets), max(independent, 10.0))


@dataclass(frozen=True, eq=False)
class Regressed:
    """Motions of records, the form of their rows, and the regression of the rig's own terms to which candidates are added."""

    motions: Sequence[Motion]
    rows: Rows
    projected: Projected
    scales: Mapping[str, float]  # size of each base quantity
    driven: bool  # whether the acceleration is regressed; else the force
    threads: IdleThreads = field(default_factory=IdleThreads)

    @classmethod
    def of(
        cls,
        rig: Rig,
        has_stiffness: bool,
        motions: Sequence[Motion],
        scales: Mapping[str, float],
        pointwise: bool = False,
        threads: IdleThreads | None = None,
    ) -> Regressed:
        """Regress the rig's own terms."""
        rows = rows_of(motions, scales["time"], pointwise)
        projected = own_regression(rig, has_stiffness, motions, rows)
        return cls(motions, rows, projected, scales, rig.is_driven, threads or IdleThreads())

    def column(self, signals: Iterable[Floats]) -> Floats:
        """Return the rows of a resisting force along all records, shape (n_rows,), with its sign in the regression."""
        own = [self.rows.of(signal, m.dt) for signal, m in zip(signals, self.motions, strict=True)]
        return (-1.0 if self.driven else 1.0) * np.concatenate(own)


def own_terms(rig: Rig, has_stiffness: bool, projected: Projected) -> dict[str, Floats]:
    """Return the columns of the rig's damper and spring, which compete in the full form."""
    motion = rig.motion
    first = 1 if rig.is_driven else 0
    own = {motion.damping.name: projected.base[:, first]}
    if has_stiffness:
        own[motion.stiffness.name] = projected.base[:, first + 1]
    return own
