"""What an equation lacks along the measured motion: terms beside its own, with numbers to start from, and the missing force.

The regression is that of a diagnosis (`rigsight.inverse`): all terms at all joints and drives compete for the force that the
equations leave, beside the numbers of the rig and the terms that an equation has already.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigsight.campaign import Campaign
from rigsight.discover.stability import inclusion_probabilities
from rigsight.effects import Effect, Family
from rigsight.identify import FitResult
from rigsight.inverse import MissingForce, along_motion, missing_forces, selection_of
from rigsight.inverse.effect_terms import EffectTerms, is_joint_force, is_late
from rigsight.inverse.equation_fit import LAW_ERROR, EquationFit
from rigsight.inverse.joint_force import effect_force, joint_motion
from rigsight.inverse.measured_motion import WIDER
from rigsight.inverse.selection import Selection
from rigsight.inverse.term import Term
from rigsight.records.record import Floats
from rigsight.rigs import Joint, Rig
from rigsight.simulate import Structure
from rigsight.units import at_place, characteristic_value

_PLACES, _FORMS = 3, 3
"""Families at places that are tried beside an equation, and forms of each: the fits decide between forms that are alike here."""
_WORTH = 0.02
"""Share of the residual that a term must remove to be tried, unless it is the best."""
_ALIKE = (1.0 - LAW_ERROR) ** 2
"""Share of the squares that the best form of a family removes from which another one is alike, to what laws err."""
_STARTS = 3
"""Sizes of sliders from which fits start."""
_COMPETING = 6
"""Terms that compete in an ensemble."""
_RIVAL = 0.9
"""Correlation with a term of the equation from which another one is its rival: it would share its draws, and fits decide."""

Values = Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Regressed:
    """Numbers at which terms explain most of the force along the motion, or nearly as much."""

    own: Mapping[str, Values]  # parameters of each effect, by its name
    numbers: Values  # of the rig

    def values(self, structure: Structure) -> dict[str, float]:
        """Return the values of a structure with these effects."""
        values = dict(self.numbers)
        for effect in structure.effects:
            for name, value in self.own.get(effect.name, {}).items():
                values[structure.parameter_name(effect, name)] = value
        return values


@dataclass(frozen=True, eq=False)
class Proposed:
    """Terms of an equation and one or more beside, with numbers to start from, the best first."""

    effects: tuple[Effect, ...]
    starts: tuple[Regressed, ...]


@dataclass(frozen=True, eq=False)
class _Chosen:
    """Terms of an equation, added to a selection: their numbers and all their columns."""

    selection: Selection
    terms: tuple[int, ...]

    @property
    def columns(self) -> list[int]:
        return self.columns_without(None)

    def columns_without(self, left_out: int | None) -> list[int]:
        return [c for i in self.terms if i != left_out for c in self.selection.places[i]]


class AlongMotion:
    """The regression of the equations of a rig along its estimation records; `modelled` effects are in every equation."""

    def __init__(self, terms_of: EffectTerms, selection: Selection, modelled: Sequence[Effect]) -> None:
        self.terms_of, self._selection, self._modelled = terms_of, selection, modelled
        self._rig = terms_of.fit.rig

    @classmethod
    def of(cls, campaign: Campaign, known: Values, effects: Sequence[Effect]) -> AlongMotion | None:
        """Return the regression; None where the sensors do not show the motion, or nothing can be a term."""
        terms_of = along_motion(campaign, known)
        selection = None if terms_of is None else selection_of(terms_of, effects)
        return None if terms_of is None or selection is None else cls(terms_of, selection, campaign.modelled)

    @property
    def numbers(self) -> Values:
        """Numbers of the rig with which its equations alone leave least."""
        return self.terms_of.values

    def at_once(self) -> Iterator[Proposed]:
        """Yield what the regression alone selects: two terms, three, and so on."""
        found = [i for _, i, _ in self._selection.selected(self._rig)]
        for n in range(2, len(found) + 1):
            yield self._proposed(_Chosen(self._selection, tuple(found[: n - 1])), found[n - 1])

    def beside(self, fit: FitResult) -> list[Proposed]:
        """Return an equation with one term more: the forms that remove most, of several families at several places."""
        chosen = self._of_equation(fit)
        there = {effect.name for effect in fit.structure.effects}
        before = self._left(chosen, ())
        families: dict[tuple[Family, str], list[tuple[float, int]]] = {}
        for left, i in self._best_of_each(chosen, self._names - there):
            effect = chosen.selection.terms[i].effect
            families.setdefault((effect.family, self._rig.where(effect)), []).append((left, i))
        found = []
        for rank, forms in enumerate(list(families.values())[:_PLACES]):
            removed = before - forms[0][0]
            if rank > 0 and removed < _WORTH * before:
                break
            near = [i for left, i in forms if before - left >= _ALIKE * removed]
            found += [self._proposed(chosen, i) for i in near[:_FORMS]]
        return found

    def instead(self, fit: FitResult, left_out: Effect, other: Effect) -> Proposed | None:
        """Return an equation with another effect in place of one of its own; None where it cannot be a term."""
        chosen = self._of_equation(fit, {left_out.name})
        best = self._best_of_each(chosen, {other.name})
        return self._proposed(chosen, best[0][1]) if best else None

    def with_law(self, fit: FitResult, law: Effect, in_place_of: Collection[str]) -> Proposed:
        """Return an equation with a law that no term is yet, in place of some of its own; it is linear in all that is fitted."""
        chosen = self._of_equation(fit, in_place_of)
        wider = _Chosen(chosen.selection.with_terms(list(self.terms_of.of(law))), chosen.terms)
        return self._proposed(wider, len(chosen.selection.terms))

    def inclusion(self, fit: FitResult, rng: np.random.Generator) -> dict[str, float]:
        """Return how often sparse regression selects each term of an equation, and the best others that are not its rivals.

        A delay or a lag is not asked: what it takes from the force looks like what smoothing does, and only fits tell. Those of
        the equation are fitted beside the others.
        """
        chosen = self._of_equation(fit)
        there = {effect.name for effect in fit.structure.effects}
        regression = chosen.selection.regression
        late = [i for i in chosen.terms if is_late(chosen.selection.terms[i].effect)]
        beside = [*regression.own, *(c for i in late for c in chosen.selection.places[i])]
        directions = np.linalg.qr(regression.matrix[:, beside])[0]

        def column(i: int) -> Floats:
            """Return a term mixed as it is beside the others, without what numbers of the rig do, of length one."""
            own = chosen.selection.places[i]
            solved = regression.solved([*chosen.columns_without(i), *own])
            mixed = regression.matrix[:, own] @ (solved[-len(own) :] * regression.size[own])
            mixed = mixed - directions @ (directions.T @ mixed)
            return np.asarray(mixed / max(float(np.linalg.norm(mixed)), np.finfo(np.float64).tiny))

        columns = {i: column(i) for i in chosen.terms if i not in late}
        asked = {t.effect.name for t in self._selection.terms if not is_late(t.effect)}
        for _, i in self._best_of_each(chosen, asked - there):
            if len(columns) >= max(_COMPETING, len(chosen.terms)):
                break
            further = column(i)
            if all(abs(float(further @ columns[own])) < _RIVAL for own in chosen.terms if own not in late):
                columns[i] = further
        if not columns:
            return {}
        target = regression.matrix[:, -1] - directions @ (directions.T @ regression.matrix[:, -1])
        matrix = np.column_stack(list(columns.values()))
        found = inclusion_probabilities(matrix, target, regression.n_rows / WIDER, rng)
        names = [chosen.selection.terms[i].effect.name for i in columns]
        return dict(zip(names, map(float, found), strict=True))

    def by_chance(self, fit: FitResult) -> str | None:
        """Return the name of the term of an equation that removes least of the force, if that is no more than chance removes."""
        chosen, shares = self._of_equation(fit), dict[str, float]()
        for i in chosen.terms:
            others = _Chosen(chosen.selection, tuple(other for other in chosen.terms if other != i))
            left = self._left(others, chosen.selection.places[i])
            shares[chosen.selection.terms[i].effect.name] = 1.0 - left / self._left(others, ())
        least = min(shares, key=lambda name: shares[name], default=None)
        return None if least is None or shares[least] > self._selection.by_chance else least

    def missing(self, fit: FitResult, joint: str) -> tuple[MissingForce, Floats]:
        """Return the force at a joint beside the terms that an equation has elsewhere, and its law there, shape (n_rows,)."""
        structure, motions = fit.structure, self.terms_of.fit.motions
        values = {**self.terms_of.values, **dict(structure.fixed), **fit.values}
        forces = [effect for effect in structure.effects if is_joint_force(effect)]
        here = [effect for effect in forces if self._rig.acts_at(effect) == joint]
        elsewhere = [effect for effect in forces if effect not in here]
        beside = EquationFit(self._rig, motions, elsewhere, (), values)
        found = next(force for force in missing_forces(beside, values, None) if force.where == joint)
        (own,) = (j for j in self._rig.mechanism.joints if j.name == joint)
        law = [np.zeros(0)]
        for motion in motions:
            moved = joint_motion(motion, own, values)
            along = (effect_force(e, structure.values_of(e, values), moved) for e in here)
            law.append(motion.thinned(sum(along, np.zeros(motion.record.n_samples))))
        return found, np.concatenate(law)

    @property
    def rig(self) -> Rig:
        """The rig of the equations."""
        return self._rig

    def is_modelled(self, effect: Effect) -> bool:
        """Return True for an effect of the given simulation."""
        return effect in self._modelled

    def is_at(self, effect: Effect, joint: Joint) -> bool:
        """Return True for a term of an equation that acts at a joint."""
        return not self.is_modelled(effect) and self._rig.acts_at(effect) == joint.name

    def size(self, dimension: str, joint: Joint) -> float:
        """Return the size that a quantity of a dimension has at a joint."""
        own = dimension if self._rig.has_one_motion else at_place(dimension, joint.name)
        return characteristic_value(own, self.terms_of.scales)

    def of_equation(
        self, fit: FitResult, left_out: Collection[str], terms_of: EffectTerms | None = None
    ) -> list[Term]:
        """Return the terms of an equation at its fitted numbers, along these motions or others.

        Those named, and what has no column along the motion, are left out.
        """
        numbers = {**dict(fit.structure.fixed), **fit.values}
        terms: list[Term] = []
        for effect in fit.structure.effects:
            if effect.name not in left_out and not self.is_modelled(effect):
                own = fit.structure.values_of(effect, numbers)
                terms += list((terms_of or self.terms_of).at(effect, own))[:1]
        return terms

    def _of_equation(self, fit: FitResult, left_out: Collection[str] = ()) -> _Chosen:
        terms = self.of_equation(fit, left_out)
        first = len(self._selection.terms)
        return _Chosen(self._selection.with_terms(terms), tuple(range(first, first + len(terms))))

    @cached_property
    def _names(self) -> frozenset[str]:
        """Names of the effects that are terms."""
        return frozenset(term.effect.name for term in self._selection.terms)

    def _best_of_each(self, chosen: _Chosen, names: Collection[str]) -> list[tuple[float, int]]:
        """Return the best term of each named effect beside chosen ones with what it leaves, the best effect first."""
        best: dict[str, tuple[float, int]] = {}
        for i, term in enumerate(self._selection.terms):
            name = term.effect.name
            if name in names and chosen.selection.allows(i, chosen.columns):
                found = (self._left(chosen, chosen.selection.places[i]), i)
                best[name] = min(best.get(name, found), found)
        return sorted(best.values())

    @staticmethod
    def _left(chosen: _Chosen, further: Sequence[int]) -> float:
        """Return the squares that an equation leaves with further columns, which are all fitted.

        Held-out records judge the fits. Beside a given force the numbers alone can shrink what is left, so it counts what is left
        of stretches that are not fitted.
        """
        regression, columns = chosen.selection.regression, [*chosen.columns, *further]
        return regression.remainder(columns) if regression.given & {*columns} else regression.misfit(columns)

    def _proposed(self, chosen: _Chosen, further: int) -> Proposed:
        """Return chosen terms and a further one."""
        longer = [_Chosen(chosen.selection, (*chosen.terms, i)) for i in self._apart(chosen, further)]
        effects = tuple(chosen.selection.terms[i].effect for i in longer[0].terms)
        return Proposed(effects, tuple(map(self._regressed, longer)))

    def _apart(self, chosen: _Chosen, best: int) -> list[int]:
        """Return a term and others of its effect with other sizes, which a fit would not reach from it.

        The sliders of a loop may be mistaken for their neighbors.
        """
        selection, found = chosen.selection, [best]
        effect = selection.terms[best].effect
        if not any(state.limit is not None for state in effect.states):
            return found
        own = [i for i, term in enumerate(self._selection.terms) if term.effect is effect]
        allowed = [i for i in own if selection.allows(i, chosen.columns)]
        for i in sorted(allowed, key=lambda i: self._left(chosen, selection.places[i])):
            inner = selection.terms[i].inner
            if len(found) < _STARTS and all(_differ(inner, selection.terms[j].inner) for j in found):
                found.append(i)
        return found

    def _regressed(self, chosen: _Chosen) -> Regressed:
        selection = chosen.selection
        own = {
            selection.terms[i].effect.name: selection.parameters(i, chosen.columns_without(i))
            for i in chosen.terms
        }
        numbers = selection.numbers_beside(1.0, {}).values(chosen.columns)
        return Regressed(own, {**self.terms_of.values, **numbers})


def _differ(first: Values, second: Values) -> bool:
    """Return whether parameters differ by a factor of two."""
    return any(
        abs(value) > 2.0 * abs(second[name]) or 2.0 * abs(value) < abs(second[name])
        for name, value in first.items()
    )
