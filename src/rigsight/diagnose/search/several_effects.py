"""Several effects where one does not explain the records: grown from one, reduced to what they need, other forms in their place.

Where the motion shows the missing force, the families that it names are fitted at once: a simulation that drifts until the last
of them is there makes one alone seem of no use. What the motion does not judge, such as a resonance, is added after them. Where
it does not show the force, effects are added to the best single one, and sets that explain the residual of the equations together
compete. Each effect must lower the held-out error; those that the others make needless are dropped, and others are tried in
their place.

References
----------
S. A. Billings, *Nonlinear System Identification* (Wiley 2013), for forward selection of terms.
A. Miller, *Subset Selection in Regression* (Chapman and Hall 2002), section 3.4, for sequential replacement.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.noise.adequacy import Checks
from rigsight.diagnose.policy import FAMILIES, SEARCH, VERDICT
from rigsight.diagnose.search.evidence_for_more import chance_of_further_cause
from rigsight.diagnose.search.first_look import FirstLook
from rigsight.diagnose.search.nested_models import in_lowest_basins, without_repeated_equations
from rigsight.diagnose.search.one_more_effect import each_once, part_of, reduced, with_causes, with_one_more
from rigsight.diagnose.search.possible_cause import is_beyond_records, leading
from rigsight.diagnose.search.single_effects import finished, followed, refine
from rigsight.diagnose.search.together import Together
from rigsight.diagnose.search.worth_fitting import SingleModels, is_delay_or_lag
from rigsight.effects import Effect, Family
from rigsight.inverse import Proposal, ProposedCause, ProposedForm
from rigsight.simulate import carried_over

Key = tuple[Family, str]
"""A family and the place at which it acts."""


Ask = Callable[[FittedModel], Proposal | None]


@dataclass(frozen=True)
class SeveralEffects:
    """What the search works with."""

    context: FitContext  # records, scales and noise
    singles: Sequence[FittedModel]  # every effect alone that could be simulated, best first
    best: FittedModel  # the best of those that are not slower or longer than the records
    # The families that the motion names; None where it does not show the missing force.
    proposal: Proposal | None
    named: FittedModel | None  # all causes that it names, fitted together
    effects: Sequence[Effect]  # candidates for a further cause
    together: Together  # sets of the effects that may be the main cause
    ask: Ask  # what the motion says of the force that a fitted model leaves
    reidentified: FittedModel  # the equations without an effect
    enough: float  # error up to which a simulation follows the motion, in units of the noise floor
    # Whether a model leaves nothing to explain, or no more than a law errs.
    is_settled: Callable[[FittedModel], bool]

    def found(self) -> list[FittedModel]:
        """Return the models of several effects and their parts."""
        models = self._pool()
        taken_apart = set[frozenset[Key]]()
        # A fit that ends lower than the best one so far may have causes that the others make needless, too.
        while models and (keys := self._keys(best := min(models, key=_error))) not in taken_apart:
            larger, parts = self._reduced(best)
            model = larger[-1]
            taken_apart |= {keys, self._keys(model)}
            if len(model.effects) < 2:
                return []
            pairs = zip(model.effects, parts, strict=True)
            others = [other for effect, part in pairs for other in self.exchanged(model, effect, part)]
            rivals = [*self._within_records(others), *models, *larger[:-1], *parts]
            models = self._compared(finished(self.context, model), rivals)
        several = [model for model in models if len(model.effects) > 1]
        if several and self.proposal is not None:
            # The place of what is late is open in every form that does as well as the best.
            most = VERDICT.worthwhile * min(map(_error, several))
            late = [one for model in several if _error(model) <= most for one in self._late_elsewhere(model)]
            several = each_once([*several, *self._within_records(late)])
        return larger_first(without_repeated_equations(self.context, several), self.singles)

    @property
    def _least_share(self) -> float:
        """Share of the residual that a further effect must explain in the screening, which is exact for small effects only."""
        return VERDICT.larger_part if self.proposal is not None else 0.0

    def _pool(self) -> list[FittedModel]:
        """Return the causes that the motion names, with further ones, and sets of those that it does not judge."""
        judged = frozenset[str]() if self.proposal is None else self.proposal.judged
        best = self.best
        if self.named is not None and self._is_worth(self.named, best):
            models = [self.named, *self._grown(self.named, judged)]
        else:
            models = list(self._grown(best, judged))
            # An effect that imitates several causes may lead, and none of them helps it further.
            further = [model for single in self._named_first() for model in self._grown(single)]
            models += [model for model in further if self._is_worth(model, best)]
        # A delay and a resonance may hide each other: neither lowers the error without the other.
        if not models or not self.is_settled(min(models, key=_error)):
            for size in (2, 3):
                sets = self.together.fitted(size, self._least_share)
                models += [one for one in sets if self._is_worth(one, best)]
        return self._within_records(models)

    def _within_records(self, models: Sequence[FittedModel]) -> list[FittedModel]:
        """Return the models without those whose effects are slower or longer than the records."""
        return [model for model in models if not is_beyond_records(model, self.context)]

    def _named_first(self) -> list[FittedModel]:
        """Return the best single of the first family that the motion names, if a single of another one is the best."""
        taken = () if self.proposal is None else self.proposal.taken[:1]
        keys = {(cause.family, cause.where) for cause in taken} - self._keys(self.best)
        return [single for single in self.singles if self._keys(single) <= keys and single.effects][:1]

    def _reduced(self, model: FittedModel) -> tuple[list[FittedModel], list[FittedModel]]:
        """Return a model and what remains of it each time that a needless effect is dropped, and the parts of the last."""
        found, parts = [model], self._parts(model)
        while needless := [part for part in parts if not self._is_worth(found[-1], part)]:
            found.append(min(needless, key=_error))
            parts = self._parts(found[-1])
        return found, parts

    def _compared(self, best: FittedModel, others: Sequence[FittedModel]) -> list[FittedModel]:
        """Return the models, each set once, with those fitted to the last digit that this may tell apart."""
        if self.is_settled(best):
            # What remains is of the size of what laws err: more digits of the others would not tell them apart.
            return each_once([*refine(self.context, [best]), *others])
        refined = refine(self.context, each_once([best, *others]))
        # The regression along the motion has no other minimum to start from.
        return each_once(refined if self.proposal is not None else in_lowest_basins(self.context, refined))

    def _grown(self, model: FittedModel, judged: frozenset[str] = frozenset()) -> Iterator[FittedModel]:
        """Yield a model with each further effect that lowers its error enough."""
        # Of the effects that the motion has `judged` only those are tried that it names beside the model.
        enough = np.inf if self.proposal is not None else VERDICT.at_floor
        for _ in range(SEARCH.most_unnamed):
            if self.is_settled(model):
                break
            # Along the motion the fitted model leaves another force than the numbers of the regression did. Where the simulation
            # does not follow the motion, its numbers are worth less than those; beside a limit of a drive nothing can be asked.
            follows = model.error_over_noise <= self.enough
            beside = self.ask(model) if follows and self.proposal is not None else None
            leaves_out = judged if beside is not None or not follows else frozenset[str]()
            further = [effect for effect in self.effects if effect.name not in leaves_out]
            larger_ones = with_one_more(self.context, model, further, self.singles, self._least_share, enough)
            if beside is not None and (new := self._new(beside, model)):
                larger_ones.append(with_causes(self.context, model, new, beside))
            best = min(self._within_records(larger_ones), key=_error, default=model)
            if not self._is_worth(best, model):
                break
            model = best
            yield model

    def _new(self, proposal: Proposal, model: FittedModel) -> list[ProposedCause]:
        """Return the causes that were taken of families that a model does not have at their places."""
        known = self._keys(model)
        return [cause for cause in proposal.taken if (cause.family, cause.where) not in known]

    def _is_worth(self, larger: FittedModel, model: FittedModel) -> bool:
        """Return True if one more effect lowers the held-out error of a model enough."""
        # More is asked where the motion does not show its force: it closes the larger part of the error, or is a probable cause
        # where no law is exact.
        error, remainder = larger.error_over_noise, model.error_over_noise
        if self.proposal is not None:
            return error <= remainder / VERDICT.worthwhile
        if error <= remainder - VERDICT.larger_part * (remainder - 1.0):
            return True
        together, without = (
            1.0 - (own / self.reidentified.error_over_noise) ** 2 for own in (error, remainder)
        )
        return chance_of_further_cause(together, without) >= FAMILIES.probable

    def _key(self, effect: Effect) -> Key:
        return effect.family, self.context.rig.where(effect)

    def _keys(self, model: FittedModel) -> frozenset[Key]:
        return frozenset(map(self._key, model.effects))

    def _parts(self, model: FittedModel) -> list[FittedModel]:
        """Return a model without each of its effects, fitted from where the others are in it."""
        kept = [
            tuple(other for other in model.effects if other is not left_out) for left_out in model.effects
        ]
        return list(self.context.threads.side_by_side(partial(part_of, self.context, model), kept))

    def exchanged(self, model: FittedModel, replaced: Effect, part: FittedModel) -> list[FittedModel]:
        """Return a model with others in the place of one of its effects; the part is the model without it."""
        # Where the motion shows the force, forms of its family at its place: those that the motion judges start from there; one
        # that leaves far more of the missing force than the best form is no candidate.
        if not part.residuals:
            return []
        others, found = [e for e in self.effects if e not in model.effects], list[FittedModel]()
        if self.proposal is not None:
            key = self._key(replaced)
            of_family = [c for c in self.proposal.taken if (c.family, c.where) == key]
            found = self._with_forms(self.proposal, of_family, model, replaced, part)
            judged = self.proposal.judged if of_family else frozenset()
            others = [effect for effect in others if self._key(effect) == key and effect.name not in judged]
        if self.is_settled(model):
            # Nothing remains for another effect, but a form with fewer numbers may do as well.
            others = [
                effect for effect in others if effect.name in replaced.parents and self.proposal is None
            ]
        if others:
            of_model = (replaced, model.fit)
            found += with_one_more(self.context, part, others, self.singles, replaced=of_model)
        return found

    def _late_elsewhere(self, model: FittedModel) -> list[FittedModel]:
        """Return a model with its delay or lag in another place: what is late there makes all readings behind it late."""
        found = list[FittedModel]()
        for late in filter(is_delay_or_lag, model.effects):
            others = [e for e in self.effects if is_delay_or_lag(e) and self._key(e) != self._key(late)]
            part = part_of(self.context, model, tuple(e for e in model.effects if e is not late))
            if others and part.residuals:
                found += with_one_more(self.context, part, others, self.singles, replaced=(late, model.fit))
        # What is tried as a cause is tried without each of its effects, too.
        of_pairs = [part for one in found if len(one.effects) > 2 for part in self._parts(one)]
        return [*found, *of_pairs]

    def _with_forms(
        self,
        proposal: Proposal,
        of_family: Sequence[ProposedCause],
        model: FittedModel,
        replaced: Effect,
        part: FittedModel,
    ) -> list[FittedModel]:
        """Return a model with other forms that the motion proposes in the place of one of its effects."""
        causes = [
            replace(cause, effect=form.effect, values=form.values)
            for cause in of_family
            for form in (ProposedForm(cause.effect, cause.values, 1.0), *cause.forms)
            if form.effect not in model.effects and SEARCH.near_force * form.left <= 1.0
        ]
        # They start from where the others are beside the form that they replace.
        kept = tuple(effect for effect in model.effects if effect is not replaced)
        structure, values = reduced(self.context, model, kept)
        beside = replace(part, fit=replace(part.fit, structure=structure, values=values))
        as_fitted = replace(proposal, numbers={})
        return [with_causes(self.context, beside, [cause], as_fitted) for cause in causes]


def _error(model: FittedModel) -> float:
    return model.error_over_noise


def several_effects(models: SingleModels, ask: Ask, checks: Checks, lower_bound: bool) -> list[FittedModel]:
    """Return models of several effects if a single effect does not explain everything."""
    # `ask` says what the motion shows of the force that a model leaves.
    context, reidentified, worth = models.context, models.reidentified, models.worth
    best = leading(context, models.singles)
    if best is None:
        return []
    usable = sorted(
        (m for m in models.singles if m.residuals and np.isfinite(m.error_over_noise)), key=_error
    )
    proposal = models.proposal if worth.is_shown else None

    def is_settled(model: FittedModel) -> bool:
        # Where errors of laws are larger than noise, a residual of the size of the error of one law asks for no second one. A
        # floor is known to a few percent, or is only a lower bound: within these the residual may be noise, so checks decide.
        error = model.error_over_noise
        if worth.is_shown:
            return error <= settled(reidentified)
        least, most = (
            (VERDICT.at_floor, VERDICT.at_lower_bound) if lower_bound else (VERDICT.exact, VERDICT.at_floor)
        )
        return error <= least or (error <= most and checks.is_adequate(model))

    if is_settled(best) or (not worth.is_shown and best.error_over_noise <= tied_at_the_floor(reidentified)):
        return []
    found = SeveralEffects(
        context,
        usable,
        best,
        proposal,
        models.together,
        models.effects,
        Together(context, reidentified, worth.alone if worth.is_shown else models.effects),
        ask,
        reidentified,
        larger_part_closed(reidentified),
        is_settled,
    ).found()
    if lower_bound and not worth.is_shown and best.error_over_noise <= VERDICT.at_lower_bound:
        found = [model for model in found if model.error_over_noise <= VERDICT.at_floor]
    return found


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
