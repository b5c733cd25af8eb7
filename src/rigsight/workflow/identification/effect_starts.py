"""From which values does the fit of a rig with the effects of its given simulation begin?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rigsight.campaign import Campaign
from rigsight.identify import GreyBoxFit, characteristic_scales, off_bounds
from rigsight.records import Record
from rigsight.simulate import compose


def start_with_effects(
    campaign: Campaign,
    windows: Sequence[Record],
    start: Mapping[str, float],
    held: Mapping[str, float],
    sizes: Mapping[str, float],
) -> dict[str, float]:
    """Return the parameters of the best of several fits: from the given values, and from inside of bounds at which they lie."""
    structure = compose(campaign.rig, campaign.modelled)
    begin = {**campaign.constants, **start, **held}
    scales = characteristic_scales(campaign.rig, windows, begin)
    fixed = {*held, *campaign.constants}
    free = [p.name for p in structure.parameters if p.fitted and p.name not in fixed]
    problem = GreyBoxFit(structure, windows, scales, sizes)
    given = {**begin, **campaign.given, **held}
    starts = [given, {**given, **begin}]
    starts += [inside for own in starts if (inside := off_bounds(structure, own, free, scales)) is not None]
    return min((problem.fit(own, free) for own in starts), key=lambda fit: fit.cost).values
