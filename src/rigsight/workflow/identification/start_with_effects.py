"""Start values of a rig with effects: those that the simulation has begin at their given numbers, others where they declare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rigsight.campaign import Campaign
from rigsight.effects import AT, CATALOGUE, Effect, placed
from rigsight.identify import FitResult, GreyBoxFit, characteristic_scales, off_bounds
from rigsight.identify.start.declared_starts import declared_starts
from rigsight.records import Record
from rigsight.simulate import Structure, carried_over, compose


def start_with_effects(
    campaign: Campaign,
    asked: Sequence[Effect],
    windows: Sequence[Record],
    start: Mapping[str, float],
    held: Mapping[str, float],
    sizes: Mapping[str, float],
) -> dict[str, float]:
    """Return the parameters of the best of several fits; `asked` are the effects of the campaign without given numbers."""
    begin = {**campaign.constants, **start, **held}
    fits = _Fits(campaign, windows, begin, held, sizes)
    found = fits.from_given([effect for effect in campaign.modelled if effect not in asked])
    for effect in asked:
        found = fits.beside(found, effect)
    return carried_over(found.values, found.structure, compose(campaign.rig, campaign.modelled))


class _Fits:
    def __init__(
        self,
        campaign: Campaign,
        windows: Sequence[Record],
        begin: Mapping[str, float],
        held: Mapping[str, float],
        sizes: Mapping[str, float],
    ) -> None:
        self._campaign, self._windows, self._begin = campaign, windows, begin
        self._held, self._sizes = held, sizes
        self._scales = characteristic_scales(campaign.rig, windows, begin)

    def from_given(self, effects: Sequence[Effect]) -> FitResult:
        """Fit the rig with effects from the given values, from those of the rig alone, and from inside of bounds."""
        structure = compose(self._campaign.rig, effects)
        given = {**self._begin, **self._campaign.given, **self._held}
        starts = [given, {**given, **self._begin}]
        inside = (off_bounds(structure, own, self._free(structure), self._scales) for own in starts)
        return self._best(structure, [*starts, *(own for own in inside if own is not None)])

    def beside(self, base: FitResult, effect: Effect) -> FitResult:
        """Fit one effect more, from the start values that it declares."""
        structure = compose(self._campaign.rig, (*base.structure.effects, effect))
        simpler = {name: _at_place_of(effect, name) for name in effect.parents}
        parents = {name: self.beside(base, own) for name, own in simpler.items() if own is not None}
        return self._best(structure, [*declared_starts(structure, effect, self._scales, base, parents)])

    def _best(self, structure: Structure, starts: Sequence[Mapping[str, float]]) -> FitResult:
        problem = GreyBoxFit(structure, self._windows, self._scales, self._sizes)
        return min((problem.fit(own, self._free(structure)) for own in starts), key=lambda fit: fit.cost)

    def _free(self, structure: Structure) -> list[str]:
        fixed = {*self._held, *self._campaign.constants}
        return [p.name for p in structure.parameters if p.fitted and p.name not in fixed]


def _at_place_of(effect: Effect, name: str) -> Effect | None:
    """Return the effect of the catalogue that another one names as simpler, at the same place."""
    kind = name.partition(AT)[0]
    own = next((known for known in CATALOGUE if known.name == kind), None)
    return own if own is None or effect.at is None else placed(own, effect.at)
