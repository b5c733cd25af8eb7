"""Search for several effects: only if the residual of the best single effect is not noise."""

from __future__ import annotations

from collections.abc import Sequence

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.fitting.preparation import Prepare
from rigsight.diagnose.noise.adequacy import Checks
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.search.basins import in_lowest_basins
from rigsight.diagnose.search.several.evidence_for_more import OtherForms
from rigsight.diagnose.search.several.joint_starts import with_joint_starts
from rigsight.diagnose.search.several.one_more_effect import is_among
from rigsight.diagnose.search.several.pairs import each_once, grown, larger_first
from rigsight.diagnose.search.several.similar_pairs import with_similar
from rigsight.diagnose.search.several.together import Together
from rigsight.diagnose.search.single_effects import refine
from rigsight.effects import Effect


def several_effects(
    context: FitContext,
    reidentified: FittedModel,
    singles: Sequence[FittedModel],
    effects: Sequence[Effect],
    forms: OtherForms,
    checks: Checks,
    lower_bound: bool,
    prepare: Prepare | None,
) -> list[FittedModel]:
    """Return models of two and three effects if a single effect does not explain everything.

    Above a lower bound of the floor the residual of a single effect may be noise: the checks decide, and a pair must reach that
    bound.
    """
    best = min(singles, key=lambda model: model.error_over_noise, default=None)
    is_excused = lower_bound and best is not None and best.error_over_noise <= VERDICT.at_lower_bound
    if best is None or (is_excused and checks.is_adequate(best)):
        return []
    at_floor = VERDICT.at_floor
    # A floor is known to a few percent. Within these, the residual of the best effect is tested for being noise.
    is_near = not lower_bound and VERDICT.exact < best.error_over_noise <= VERDICT.at_floor
    if is_near and not checks.is_adequate(best):
        at_floor = VERDICT.exact
    worthwhile = reidentified.error_over_noise / VERDICT.worthwhile
    together = Together(context, reidentified, effects, prepare)

    def is_enough(pair: FittedModel) -> bool:
        return lower_bound or checks.is_adequate(pair)

    pairs = grown(context, singles, effects, at_floor, worthwhile, forms, together, is_enough, prepare)
    known = in_lowest_basins(context, pairs)
    pairs = with_joint_starts(context, reidentified, known, singles, effects, checks.is_adequate, prepare)
    if pairs and not is_among(known, set(pairs[0].names)):
        of_two = [model for model in pairs if len(model.effects) == 2]
        similar = with_similar(context, of_two, singles, effects, prepare)
        pairs = larger_first(refine(context, each_once([*pairs, *similar])), singles)
    return [pair for pair in pairs if not is_excused or pair.error_over_noise <= VERDICT.at_floor]
