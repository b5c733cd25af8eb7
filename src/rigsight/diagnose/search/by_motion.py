"""Several effects where the motion shows the missing force: the families that it names, fitted together.

The regression along the motion finds several causes at once, each with its numbers. They are fitted at once: where a simulation
drifts until the last of them is there, one alone seems to be of no use. The motion does not judge a
resonance: so effects whose push explains the larger part of the residual of the simulation are added after them. Each must lower
the held-out error; those that the others make needless are dropped, and other forms of each family are tried in their place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.one_more_effect import each_once, part_of, reduced, with_causes, with_one_more
from rigsight.diagnose.search.single_effects import finished, refine
from rigsight.diagnose.search.together import Together
from rigsight.effects import Effect, Family
from rigsight.inverse import Proposal, ProposedCause, ProposedForm

Key = tuple[Family, str]
"""A family and the place at which it acts."""


Ask = Callable[[FittedModel], Proposal | None]


@dataclass(frozen=True)
class NamedByMotion:
    """What the search works with."""

    context: FitContext  # records, scales and noise
    singles: Sequence[FittedModel]  # every effect alone that could be simulated, best first
    proposal: Proposal  # the families that the motion names
    named: FittedModel | None  # all causes that it names, fitted together
    effects: Sequence[Effect]  # candidates for a further cause
    together: Together  # sets of the effects that may be the main cause
    ask: Ask  # what the motion says of the force that a fitted model leaves
    enough: float  # error up to which a simulation follows the motion, in units of the noise floor
    settled: float  # error up to which nothing remains to explain, or no more than a law errs

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
            forms = [form for effect, part in pairs for form in self._other_forms(model, effect, part)]
            models = self._compared(finished(self.context, model), [*forms, *models, *larger[:-1], *parts])
        return [found for found in models if len(found.effects) > 1]

    def _pool(self) -> list[FittedModel]:
        """Return the causes that the motion names, with further ones, and sets of those that it does not judge."""
        models = list(self._grown(self.singles[0]))
        # A delay and a resonance may hide each other: neither lowers the error without the other.
        if min(map(_error, models), default=np.inf) > self.settled:
            for size in (2, 3):
                sets = self.together.fitted(size, VERDICT.larger_part)
                models += [one for one in sets if self._is_worth(one, self.singles[0])]
        return models

    def _reduced(self, model: FittedModel) -> tuple[list[FittedModel], list[FittedModel]]:
        """Return a model and what remains of it each time that a needless effect is dropped, and the parts of the last."""
        found, parts = [model], self._parts(model)
        while needless := [part for part in parts if not self._is_worth(found[-1], part)]:
            found.append(min(needless, key=_error))
            parts = self._parts(found[-1])
        return found, parts

    def _compared(self, best: FittedModel, others: Sequence[FittedModel]) -> list[FittedModel]:
        """Return the models, each set once, with those fitted to the last digit that this may tell apart."""
        if best.error_over_noise <= self.settled:
            # What remains is of the size of what laws err: more digits of the others would not tell them apart.
            return each_once([*refine(self.context, [best]), *others])
        # The regression along the motion has no other minimum to start from.
        return each_once(refine(self.context, each_once([best, *others])))

    def _grown(self, model: FittedModel) -> Iterator[FittedModel]:
        """Yield the causes that the motion names, where they explain more, then with each further one that lowers the error."""
        if self.named is not None and self._is_worth(self.named, model):
            model = self.named
            yield model
        unjudged = [effect for effect in self.effects if effect.name not in self.proposal.judged]
        for _ in range(SEARCH.most_unnamed):
            if model.error_over_noise <= self.settled:
                break
            # Along the motion the fitted model leaves another force than the numbers of the regression did. Where the simulation
            # does not follow the motion, its numbers are worth less than those; beside a limit of a drive nothing can be asked.
            follows = model.error_over_noise <= self.enough
            beside = self.ask(model) if follows else None
            further = unjudged if beside is not None or not follows else self.effects
            larger_ones = with_one_more(self.context, model, further, [], self.singles, VERDICT.larger_part)
            if beside is not None and (new := self._new(beside, model)):
                larger_ones.append(with_causes(self.context, model, new, beside))
            best = min(larger_ones, key=_error, default=model)
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
        return larger.error_over_noise <= model.error_over_noise / VERDICT.worthwhile

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

    def _other_forms(self, model: FittedModel, replaced: Effect, part: FittedModel) -> list[FittedModel]:
        """Return a model with other effects of the family of one at its place; the part is the model without it."""
        # Those that the motion judges start from there; one that leaves far more of the missing force than the best form is no
        # candidate.
        key = self._key(replaced)
        if not part.residuals:
            return []
        of_family = [c for c in self.proposal.taken if (c.family, c.where) == key]
        causes = [
            replace(cause, effect=form.effect, values=form.values)
            for cause in of_family
            for form in (ProposedForm(cause.effect, cause.values, 1.0), *cause.forms)
            if form.effect not in model.effects and SEARCH.near_force * form.left <= 1.0
        ]
        known = self.proposal.judged if of_family else frozenset()
        # They start from where the others are beside the form that they replace.
        kept = tuple(effect for effect in model.effects if effect is not replaced)
        structure, values = reduced(self.context, model, kept)
        beside = replace(part, fit=replace(part.fit, structure=structure, values=values))
        as_fitted = replace(self.proposal, numbers={})
        forms = [
            e for e in self.effects if self._key(e) == key and e not in model.effects and e.name not in known
        ]
        found = [with_causes(self.context, beside, [cause], as_fitted) for cause in causes]
        if forms and model.error_over_noise > self.settled:
            of_model = (replaced, model.fit)
            found += with_one_more(self.context, part, forms, [], self.singles, replaced=of_model)
        return found


def _error(model: FittedModel) -> float:
    return model.error_over_noise
