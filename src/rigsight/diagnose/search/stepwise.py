"""Several effects where one does not explain the records: added one by one or together, exchanged, and reduced to their parts.

There is one pool of fitted models. Each step adds models with one effect more: sets that explain the residual of the equations
together, and extensions of the best models with one effect less. Then each effect of the best is exchanged for others. A step
must close half of the error that the best model with fewer effects leaves; else the search ends. The parts of what was found are
fitted from there, so that a set competes with them in the ranking.

References
----------
S. A. Billings, *Nonlinear System Identification* (Wiley 2013), for forward selection of terms.
A. Miller, *Subset Selection in Regression* (Chapman and Hall 2002), section 3.4, for sequential replacement.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.noise.adequacy import Checks
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.by_motion import Ask, NamedByMotion
from rigsight.diagnose.search.evidence_for_more import OtherForms
from rigsight.diagnose.search.first_look import LOOK_ACCURACY, FirstLook
from rigsight.diagnose.search.nested_models import in_lowest_basins, without_repeated_equations
from rigsight.diagnose.search.one_more_effect import each_once, part_of, reduced, with_one_more
from rigsight.diagnose.search.single_effects import finished, followed, refine
from rigsight.diagnose.search.together import Together
from rigsight.diagnose.search.worth_fitting import SingleModels
from rigsight.effects import Effect
from rigsight.simulate import carried_over


@dataclass(frozen=True)
class Stepwise:
    """What the search works with."""

    context: FitContext  # records, scales and noise
    singles: Sequence[FittedModel]  # every effect alone that could be simulated, best first
    effects: Sequence[Effect]  # candidates for a further cause
    forms: OtherForms  # how much another form of an effect would explain
    together: Together  # sets of effects that explain the residual of the equations

    def found(self, at_floor: float, checks: Checks | None) -> list[FittedModel]:
        """Return the models of several effects that compete, and their parts, best first."""
        # `at_floor` is the error at which nothing remains to explain; a model near it is also asked whether its residual is
        # noise.
        before, competing = self.singles[0].error_over_noise, list[FittedModel]()
        parts: list[FittedModel] = []
        for size in range(2, SEARCH.most_effects + 1):
            if before <= at_floor:
                break
            is_grown = size == 2 or bool(competing)
            allowed = half_closed(before)
            larger = self._of_size(size, [*competing, *parts], at_floor, allowed, is_grown)
            enough = [model for model in larger if model.error_over_noise <= allowed]
            if size == 2:
                parts = larger
            if enough:
                parts = self.with_parts(enough[0], parts)
                competing += enough
            nearest = min((m.error_over_noise for m in [*enough, *competing]), default=before)
            if checks is not None and VERDICT.exact < nearest <= at_floor and enough:
                at_floor = at_floor if checks.is_adequate(enough[0]) else VERDICT.exact
            before = nearest
        names = [set(model.names) for model in competing]
        parts = [model for model in parts if any(set(model.names) < own for own in names)]
        models = each_once([*competing, *parts])
        return larger_first(without_repeated_equations(self.context, models), self.singles)

    def _of_size(
        self, size: int, smaller: Sequence[FittedModel], at_floor: float, allowed: float, is_grown: bool
    ) -> list[FittedModel]:
        """Return models with so many effects, best first; those that compete fitted to convergence, with effects exchanged."""
        found = self._best_converged(self.together.fitted(size))
        if is_grown:
            parents = self._parents() if size == 2 else smaller[:1]
            for parent in parents:
                if _lowest(found) <= VERDICT.exact:
                    break
                found += self._extended(parent, found, at_floor if parent is parents[0] else np.inf)
        found = each_once(found)
        if not _lowest(found) <= allowed:
            return found
        return self.settled(self.exchanged(found))

    def _extended(
        self, parent: FittedModel, known: Sequence[FittedModel], enough: float
    ) -> list[FittedModel]:
        if len(parent.effects) > 1:
            least = max(VERDICT.larger_part, self.forms.share(parent))
            return with_one_more(self.context, parent, self.effects, known, self.singles, least)
        # Pairs fitted from where the screening puts them may have ended in another minimum: others start from a single effect.
        settled = [pair for pair in known if pair.error_over_noise <= VERDICT.exact]
        partners = self.forms.partners(parent, self.effects)
        return with_one_more(self.context, parent, partners, settled, self.singles, enough=enough)

    def _parents(self) -> list[FittedModel]:
        """Return the single effects to which a second one is added: the plainest of those near the best, and unlike ones."""
        # Of those that explain as much, the one with the fewest numbers leaves most for a second to explain; of those with as
        # many, the one that the catalogue has first is the plainer.
        nearest = self.singles[0].error_over_noise
        close = [model for model in self.singles if model.error_over_noise <= SEARCH.beam * nearest]
        best = min(close, key=lambda model: (model.n_free, model.error_over_noise))
        first = self._plainest([model for model in close if model.n_free == best.n_free], best)
        others = [model for model in close if model is not first and not _alike(first, model)]
        others = [model for model in others if max(model.fit.substeps) <= SEARCH.finest_steps]
        return [first, *([self._plainest(others, others[0])] if others else [])]

    def _plainest(self, models: Sequence[FittedModel], like: FittedModel) -> FittedModel:
        """Return of the models that explain as much as one of them that with the fewest numbers, the catalogue's first."""
        order = {effect.name: place for place, effect in enumerate(self.effects)}
        tied = [m for m in models if m.error_over_noise <= SEARCH.alike_pairs * like.error_over_noise]
        return min(tied, key=lambda model: (model.n_free, order.get(model.names[0], len(order))))

    def exchanged(self, found: Sequence[FittedModel]) -> list[FittedModel]:
        """Return the models with those in which another effect stands for one of the best."""
        # One found beside an incomplete model may only be similar to the right one, or more general than needed.
        known = list(found)
        replaced: FittedModel | None = None
        for _ in range(SEARCH.most_swaps):
            best = min(known, key=lambda model: model.error_over_noise, default=None)
            if best is None or best is replaced or best.error_over_noise <= VERDICT.exact:
                break
            replaced = best
            for effect in best.effects:
                parent = self._without(best, effect)
                known += with_one_more(
                    self.context,
                    parent,
                    self.effects,
                    known,
                    self.singles,
                    replaced=(effect, best.fit),
                )
        return each_once(known)

    def _without(self, model: FittedModel, left_out: Effect) -> FittedModel:
        """Return a model without one of its effects, at the values that it has: the residual is what that effect explains."""
        kept = tuple(effect for effect in model.effects if effect is not left_out)
        structure, values = reduced(self.context, model, kept)
        fit = self.context.problem(structure, self.context.estimation, LOOK_ACCURACY).fit(values, [])
        free = tuple(self.context.free_parameters(structure))
        errors = {name: model.fit.standard_errors.get(name, 0.0) for name in free}
        return self.context.score(kept, replace(fit, free=free, standard_errors=errors), roughly=True)

    def with_parts(self, model: FittedModel, known: Sequence[FittedModel]) -> list[FittedModel]:
        """Return the known models with the parts of one, of two effects and more, fitted from where they are in it."""
        sets = [
            effects
            for size in range(2, len(model.effects))
            for effects in itertools.combinations(model.effects, size)
        ]
        parts = list(self.context.threads.side_by_side(partial(part_of, self.context, model), sets))
        return each_once([*known, *refine(self.context, parts)])

    def _best_converged(self, models: Sequence[FittedModel]) -> list[FittedModel]:
        """Return the models, best first, that one fitted to convergence: what is compared with a limit."""
        ordered = sorted(models, key=lambda model: model.error_over_noise)
        return [
            *refine(self.context, [finished(self.context, model) for model in ordered[:1]]),
            *ordered[1:],
        ]

    def settled(self, models: Sequence[FittedModel]) -> list[FittedModel]:
        """Return the models, best first, with the best two, and those that explain as much, fitted to convergence."""
        # Of two that are one law, such as a late drive and a late sensor, the one that is finished alone would win.
        last = models[: SEARCH.most_finished][-1].error_over_noise if models else 0.0
        n_finished = sum(model.error_over_noise <= SEARCH.alike_pairs * last for model in models)
        settled = [finished(self.context, model) for model in models[:n_finished]]
        return each_once(
            in_lowest_basins(self.context, refine(self.context, [*settled, *models[n_finished:]]))
        )


def several_effects(
    models: SingleModels,
    ask: Ask,
    forms: OtherForms,
    checks: Checks,
    lower_bound: bool,
) -> list[FittedModel]:
    """Return models of several effects if a single effect does not explain everything."""
    # `ask` says what the motion shows of the force that a model leaves. Above a lower bound of the floor the residual of a single
    # effect may be noise: the checks decide, and a pair must reach that bound. Where errors of laws are larger than noise, a
    # residual of the size of the error of one law asks for no second one.
    context, reidentified, worth = models.context, models.reidentified, models.worth
    usable = sorted(
        (model for model in models.singles if model.residuals and np.isfinite(model.error_over_noise)),
        key=lambda model: model.error_over_noise,
    )
    if not usable:
        return []
    best = usable[0]
    enough = settled(reidentified)
    if worth.is_shown and best.error_over_noise <= enough:
        return []
    if worth.is_shown and models.proposal is not None:
        sets = Together(context, reidentified, worth.alone)
        closed = larger_part_closed(reidentified)
        named = NamedByMotion(
            context,
            usable,
            models.proposal,
            models.together,
            models.effects,
            sets,
            ask,
            closed,
            enough,
        ).found()
        return larger_first(without_repeated_equations(context, each_once(named)), usable)
    if best.error_over_noise <= tied_at_the_floor(reidentified):
        return []
    is_excused = lower_bound and best.error_over_noise <= VERDICT.at_lower_bound
    if is_excused and checks.is_adequate(best):
        return []
    # A floor is known to a few percent. Within these, the residual of the best effect is tested for being noise.
    is_near = not lower_bound and VERDICT.exact < best.error_over_noise <= VERDICT.at_floor
    at_floor = VERDICT.exact if is_near and not checks.is_adequate(best) else VERDICT.at_floor
    together = Together(context, reidentified, models.effects)
    search = Stepwise(context, usable, models.effects, forms, together)
    found = search.found(at_floor, None if lower_bound else checks)
    return [model for model in found if not is_excused or model.error_over_noise <= VERDICT.at_floor]


def settled(reidentified: FittedModel) -> float:
    """Return the error at which nothing remains to explain, or no more than a law errs, in units of the noise floor."""
    return max(VERDICT.at_floor, SEARCH.law_error * reidentified.error_over_noise)


def tied_at_the_floor(reidentified: FittedModel) -> float:
    """Return the error of a single effect that ties in the ranking with any pair, in units of the noise floor."""
    # What remains is too small a part of the gap to tell a second cause from a disturbance, and the single effect is plainer.
    return 1.0 + VERDICT.inexact * reidentified.error_over_noise


def larger_part_closed(reidentified: FittedModel) -> float:
    """Return the error at which the larger part of the squared gap is closed, in units of the noise floor."""
    return reidentified.error_over_noise * float(np.sqrt(1.0 - VERDICT.larger_part))


def half_closed(remainder: float) -> float:
    """Return the error that one more effect may leave, in units of the noise floor."""
    return remainder - VERDICT.larger_part * (remainder - 1.0)


def larger_first(models: Sequence[FittedModel], singles: Sequence[FittedModel]) -> list[FittedModel]:
    """Return models with the effect that explains more alone in first place."""
    alone = {model.names[0]: model.error_over_noise for model in singles}

    def remainder(effect: Effect) -> float:
        return alone.get(effect.name, np.inf)

    return [replace(model, effects=tuple(sorted(model.effects, key=remainder))) for model in models]


def refit_singles(
    context: FitContext, singles: Sequence[FittedModel], larger: Sequence[FittedModel]
) -> list[FittedModel]:
    """Return the singles, refitted where they are better from their values in a larger model than from their own starts."""
    # A second effect may only help the fit of the first out of a local minimum; the first alone then explains as much.
    better = {model.names: model for model in singles}
    for model in sorted(larger, key=lambda model: model.error_over_noise)[: SEARCH.most_refitted]:
        for effect in model.effects:
            known = better.get((effect.name,))
            if known is not None and known.error_over_noise <= SEARCH.alike_pairs * model.error_over_noise:
                continue
            structure = context.simplest((effect,)) if known is None else known.fit.structure
            free = tuple(context.free_parameters(structure)) if known is None else known.fit.free
            values = {
                **(known or model).fit.values,
                **dict(structure.fixed),
                **carried_over(model.fit.values, model.fit.structure, structure),
            }
            start = replace((known or model).fit, values={name: values[name] for name in structure.names})
            alone = followed(
                context, FirstLook((effect,), structure, free, (start,), float("inf")), promising=True
            )
            # One that was left out of the singles, as another said the same, comes back only where it is all that is needed.
            if alone.error_over_noise <= (
                SEARCH.alike_pairs * model.error_over_noise
                if known is None
                else known.error_over_noise / SEARCH.alike_pairs
            ):
                better[alone.names] = alone
    return list(better.values())


def _lowest(models: Sequence[FittedModel]) -> float:
    return min((model.error_over_noise for model in models), default=np.inf)


def _alike(one: FittedModel, other: FittedModel) -> bool:
    """Return True if one is a special or limiting case of the other: the effect missing in addition is the same."""
    parents = {name for model in (one, other) for effect in model.effects for name in effect.parents}
    return bool(parents & {*one.names, *other.names})
