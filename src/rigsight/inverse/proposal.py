"""The missing force first: which families of effects at which places explain what the equations leave along the measured motion.

The equations of motion are a regression along the motion that the sensors show: their numbers and those of the effects are linear
in it or tried on a grid, so its optimum is global and nothing is simulated. Families are taken one by one, the one first that
removes most of the residual of stretches that it was not fitted to. It proposes; fits of the simulation decide.

References
----------
J. Swevers, W. Verdonck and J. De Schutter, IEEE Control Systems 27 (2007) 58, for inverse dynamics as a regression.
S. A. Billings, *Nonlinear System Identification* (Wiley 2013), for greedy forward selection of terms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.campaign import Campaign
from rigsight.effects import Effect, Family, kind_of
from rigsight.errors import SimulationError
from rigsight.identify import characteristic_scales
from rigsight.inverse.effect_terms import EffectTerms, Term, is_joint_force
from rigsight.inverse.equation_fit import (
    EquationFit,
    held_numbers,
    matters,
    of_undriven,
    record_motions,
    with_all_inputs,
)
from rigsight.inverse.measured_motion import WIDER
from rigsight.inverse.missing_force import MissingForce, missing_forces, noise_of_rows
from rigsight.rigs import Rig

Floats = NDArray[np.float64]
Key = tuple[Family, str]
"""A family and the place at which it acts."""

_STRETCHES = 10
"""Number of parts of the records of which each is left out once."""
_MOST_CAUSES = 5
"""Families that are taken at most; a robot has three to five causes at once."""
_WORTH = 0.03
"""Least share of the residual that a further family must remove from stretches that it was not fitted to."""
_SIGNIFICANCE = 0.01
_SMOOTH = 1e-9


@dataclass(frozen=True)
class ProposedCause:
    """A family at a place, in the form that explains most."""

    effect: Effect
    family: Family
    where: str
    # Share of the squared residual of held-out stretches that it removes beside those taken before, each
    # family alone for those not taken.
    share: float
    values: Mapping[str, float]  # parameters of the effect, as far as the regression gives them

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "family": str(self.family),
            "where": self.where,
            "effect": kind_of(self.effect.name),
            "share": self.share,
            "parameters": dict(self.values),
        }


@dataclass(frozen=True)
class Proposal:
    """What a regression along the measured motion says of the missing force."""

    taken: tuple[ProposedCause, ...]  # in the order in which they were taken
    alone: tuple[ProposedCause, ...]  # every family at every place by itself, the largest share first
    judged: frozenset[str]  # names of the effects that are terms of this regression
    # Share of the squared residual that those taken remove together.
    explained: float
    # Share that the best of so many terms exceeds in one of a hundred cases if none has to do with the
    # residual.
    by_chance: float
    # Share of the squared residual that noise of the sensors causes; None where their noise is not known.
    noise: float | None = None
    # At each joint, of any shape, the one that explains most first.
    forces: tuple[MissingForce, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return ``missing_force`` of ``diagnosis.json``."""
        return {
            "joints": [force.to_json() for force in self.forces],
            "families": [cause.to_json() for cause in self.alone if cause.share > self.by_chance],
            "taken": [cause.to_json() for cause in self.taken],
            "explained": self.explained,
            "by_chance": self.by_chance,
            "noise": self.noise,
        }


def propose(
    campaign: Campaign,
    known: Mapping[str, float],
    effects: Sequence[Effect],
    noise: Mapping[str, float] | None = None,
) -> Proposal | None:
    """Return the families that explain what the equations of a campaign leave of its estimation records.

    None where the sensors do not show the motion, another program simulates the bodies, or the given simulation has an effect
    that is no force at a joint.

    Parameters
    ----------
    campaign
        Records and rig.
    known
        Constants and parameters of the rig and of the modelled effects; those of the drives set the scale of all forces.
    effects
        Candidates at their places.
    noise
        Standard deviation of the noise of each sensor; it weighs the joints of a rig against each other.
    """
    rig = campaign.rig
    if rig.mechanism.bodies is not None or not all(map(is_joint_force, campaign.modelled)):
        return None
    try:
        fit, values = _fitted(campaign, known)
    except SimulationError:
        return None
    own = {p.name: values[p.name] for p in (*rig.constants, *rig.parameters)}
    records = [with_all_inputs(rig, record) for record in campaign.estimation]
    scales = characteristic_scales(rig, records, own)
    terms_of = EffectTerms(fit, values, scales)
    terms = [term for effect in effects for term in terms_of.of(effect)]
    covariance = noise_of_rows(fit, values, noise or {})
    by_noise = None
    if covariance is not None:
        by_noise = min(1.0, float(np.mean(np.diag(covariance) / fit.rms(values) ** 2)))
    found = (
        _Selection(fit, values, terms).proposal(rig)
        if terms
        else Proposal((), (), frozenset(), explained=0.0, by_chance=1.0)
    )
    return replace(found, noise=by_noise, forces=missing_forces(fit, values, covariance))


def _fitted(campaign: Campaign, known: Mapping[str, float]) -> tuple[EquationFit, dict[str, float]]:
    rig = campaign.rig
    held = held_numbers(rig) | ({campaign.absent_spring} if campaign.absent_spring else set())
    start = {p.name: p.default if p.default is not None else 1.0 for p in rig.parameters}
    start |= {**campaign.constants, **known}
    motions = record_motions(rig, campaign.estimation, start)
    held |= of_undriven(motions, start)
    free = tuple(p.name for p in rig.parameters if p.name not in held and matters(motions, start, p.name))
    # A constant force and the rest of a spring do the same: the rest stays where it is known.
    of_rest = {symbol.name for joint in rig.mechanism.joints for symbol in joint.rest.free_symbols}
    ordered = sorted(free, key=lambda name: name in of_rest)
    fit = EquationFit(rig, motions, campaign.modelled, ordered)
    fit = EquationFit(rig, motions, campaign.modelled, fit.independent(start))
    return fit, fit.settled(start)[0]


class _Selection:
    """Greedy selection of families by the residual of held-out stretches, on sums of products."""

    def __init__(self, fit: EquationFit, values: Mapping[str, float], terms: Sequence[Term]) -> None:
        self.fit, self.terms = fit, terms
        rows, slopes, columns, stretch = [], [], [], []
        unit = fit.rms(values)[:, None]
        per_record = max(1, round(2 * _STRETCHES / len(fit.motions)))
        for i, motion in enumerate(fit.motions):
            own = motion.thinned(fit.residual(motion, values))
            rows.append(np.ravel(own / unit))
            slopes.append(_as_columns(motion.thinned(fit.slopes(motion, values)) / unit))
            columns.append([_as_columns(term.columns[i] / unit) for term in terms])
            n_equations, n = own.shape
            stretch.append(np.tile(i * per_record + (np.arange(n) * per_record) // n, n_equations))
        target = -np.concatenate(rows)
        regressors = [
            np.concatenate(slopes),
            *(np.concatenate(parts) for parts in zip(*columns, strict=True)),
        ]
        matrix = np.column_stack([*regressors, target])
        self.size = np.sqrt(np.mean(matrix**2, axis=0))
        self.size[self.size == 0.0] = 1.0
        self.size[-1] = 1.0
        matrix, self.n_rows = matrix / self.size, target.size
        self.own = list(range(regressors[0].shape[1]))
        ends = np.cumsum([part.shape[1] for part in regressors])
        self.places = [list(range(a, b)) for a, b in pairwise(ends)]
        groups = np.concatenate(stretch) % _STRETCHES
        self.products = np.array([matrix[groups == g].T @ matrix[groups == g] for g in range(_STRETCHES)])
        self.whole = np.sum(self.products, axis=0)
        # Limit of the largest of so many squared normal deviates (Bonferroni), as a share of the squares of all rows. What laws
        # leave moves with the motion: in its band lie fewer rows than in that of the forces.
        independent = target.size / WIDER
        self.by_chance = min(1.0, 2.0 * math.log(len(terms) / _SIGNIFICANCE) / independent)

    def _solved(self, products: Floats, columns: Sequence[int]) -> Floats:
        normal = products[np.ix_(columns, columns)]
        ridge = _SMOOTH * self.n_rows * np.eye(len(columns))
        return np.asarray(np.linalg.solve(normal + ridge, products[columns, -1]))

    def _remainder(self, chosen: Sequence[int]) -> float:
        """Return the sum of squares of held-out stretches with further columns beside those of the equations."""
        columns = [*self.own, *chosen]
        total = 0.0
        for left_out in self.products:
            x = self._solved(self.whole - left_out, columns)
            total += float(
                left_out[-1, -1]
                - 2.0 * x @ left_out[columns, -1]
                + x @ left_out[np.ix_(columns, columns)] @ x
            )
        return max(total, 0.0)

    def _best(self, rig: Rig, chosen: Sequence[int], taken: Sequence[Key]) -> dict[Key, tuple[float, int]]:
        """Return the best term of each family at each place beside columns that were chosen, with what it leaves."""
        best: dict[Key, tuple[float, int]] = {}
        for i, term in enumerate(self.terms):
            key = (term.effect.family, rig.where(term.effect))
            if key in taken:
                continue
            columns = [*chosen, *self.places[i]]
            own = self._solved(self.whole, [*self.own, *columns])[-len(self.places[i]) :]
            if any(sided and number < 0.0 for sided, number in zip(term.one_sided, own, strict=True)):
                continue
            remainder = self._remainder(columns)
            if key not in best or remainder < best[key][0]:
                best[key] = (remainder, i)
        return best

    def proposal(self, rig: Rig) -> Proposal:
        """Take families until none removes enough."""
        begun = remainder = self._remainder([])
        chosen: list[int] = []
        taken: list[ProposedCause] = []
        alone: tuple[ProposedCause, ...] = ()
        for _ in range(_MOST_CAUSES):
            best = self._best(rig, chosen, [(cause.family, cause.where) for cause in taken])
            ordered = sorted(best.items(), key=lambda found: found[1][0])
            if not alone:
                alone = tuple(self._cause(key, i, 1.0 - own / begun, []) for key, (own, i) in ordered)
            if not ordered or not ordered[0][1][0] < (1.0 - max(_WORTH, self.by_chance)) * remainder:
                break
            key, (own, i) = ordered[0]
            taken.append(self._cause(key, i, 1.0 - own / remainder, chosen))
            chosen, remainder = [*chosen, *self.places[i]], own
        judged = frozenset(term.effect.name for term in self.terms)
        explained = 1.0 - remainder / begun if begun > 0.0 else 0.0
        return Proposal(tuple(taken), alone, judged, explained, self.by_chance)

    def _cause(self, key: Key, i: int, share: float, chosen: Sequence[int]) -> ProposedCause:
        term, columns = self.terms[i], [*self.own, *chosen, *self.places[i]]
        numbers = self._solved(self.whole, columns)[-len(self.places[i]) :] / self.size[self.places[i]]
        linear = {
            name: float(number) * unit
            for name, number, unit in zip(term.names, numbers, term.units, strict=False)
        }
        return ProposedCause(term.effect, *key, share, {**term.inner, **linear})


def _as_columns(rows: Floats) -> Floats:
    """Return rows (n_columns, n_equations, n_rows) as columns with all equations one after the other."""
    return np.reshape(rows, (rows.shape[0], rows.shape[1] * rows.shape[2])).T
