"""From which values does the fit of a rig with the effects of its given simulation begin?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rigsight.campaign import Campaign
from rigsight.diagnose.fitting.fit_context import FitContext
from rigsight.diagnose.search.starts import start_values
from rigsight.identify import FitResult, characteristic_scales
from rigsight.records import Record
from rigsight.simulate import Structure, compose


def start_with_effects(
    campaign: Campaign,
    windows: Sequence[Record],
    start: Mapping[str, float],
    held: Mapping[str, float],
    sizes: Mapping[str, float],
) -> dict[str, float]:
    """Return the parameters of the better of two fits: from the given values, and from sizes that the records suggest.

    A given size of zero lies on a bound, from where a fit may not find its way: the second fit begins with the rig alone and
    adds the effects one after another, each at that of its typical sizes from which the error is smallest.

    Parameters
    ----------
    campaign
        Its simulation has effects.
    windows
        The estimation records, cut as they are fitted.
    start
        Start values of the rig's own parameters.
    held
        Parameters that keep their value.
    sizes
        How much each output moves.
    """
    rig, modelled = campaign.rig, campaign.modelled
    begin = {**campaign.constants, **start, **held}
    scales = characteristic_scales(rig, windows, begin)
    cut = tuple(windows)
    context = FitContext(
        rig=rig, estimation=cut, scoring=cut, look=cut, scales=scales, noise=sizes, held=frozenset(held)
    )

    def fitted(structure: Structure, values: Mapping[str, float]) -> FitResult:
        fixed = {*held, *campaign.constants}
        free = [p.name for p in structure.parameters if p.fitted and p.name not in fixed]
        return context.problem(structure, windows).fit(values, free)

    def error_at(structure: Structure, values: Mapping[str, float]) -> float:
        return context.problem(structure, windows).fit(values, (), finish=False).cost

    from_given = fitted(compose(rig, modelled), {**begin, **campaign.given, **held})
    grown = fitted(compose(rig), begin)
    for count, effect in enumerate(modelled, 1):
        structure = compose(rig, modelled[:count])
        starts = list(start_values(context, structure, effect, grown, {}))
        if not starts:
            return from_given.values
        best = min(starts, key=lambda values: error_at(structure, values)) if len(starts) > 1 else starts[0]
        grown = fitted(structure, best)
    found = min((from_given, grown), key=lambda fit: fit.cost if math.isfinite(fit.cost) else math.inf)
    return found.values
