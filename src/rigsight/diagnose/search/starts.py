"""From which values the fit of a candidate is started: its own guesses, and the fits of simpler effects."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping

from rigsight.diagnose.fitting.fit_context import FitContext
from rigsight.diagnose.search.waves import wave_starts
from rigsight.effects import Effect, placed_dimension
from rigsight.frequency.persistent_line import persistent_line
from rigsight.identify import FitResult
from rigsight.identify.fit.windows import leading_output
from rigsight.identify.start.declared_starts import declared_values, in_structure, moved_starts
from rigsight.simulate import Structure, carried_over
from rigsight.units import characteristic_value

ENDLESS = 1e100
"""Null values from here on stand for infinity."""


def start_values(
    context: FitContext,
    structure: Structure,
    effect: Effect,
    base: FitResult,
    parents: Mapping[str, FitResult],
) -> Iterator[dict[str, float]]:
    """Yield start values of all parameters for a fit with `effect`."""
    starts = list(_plain_starts(context, structure, effect, base, parents))
    if effect.wave_number is not None:
        waves = [with_own_values(structure, effect, base, own) for own in wave_starts(context, effect, base)]
        yield from waves or starts
        return
    yield from starts
    line = _line(context, base) if effect.pulsation is not None else None
    if line is not None:
        yield {**starts[0], structure.parameter_name(effect, str(effect.pulsation)): line}


def _line(context: FitContext, base: FitResult) -> float | None:
    if len(base.residuals) != len(context.estimation):
        return None
    output = leading_output(context.rig, context.estimation)
    column = [signal.name for signal in context.rig.outputs].index(output)
    seen = [
        (residual[:, column], record.dt)
        for residual, record in zip(base.residuals, context.estimation, strict=True)
        if output in record
    ]
    return persistent_line([residual for residual, _ in seen], [dt for _, dt in seen])


def _plain_starts(
    context: FitContext,
    structure: Structure,
    effect: Effect,
    base: FitResult,
    parents: Mapping[str, FitResult],
) -> Iterator[dict[str, float]]:
    fitted = [p for p in effect.parameters if p.fitted and p.name not in effect.special_cases]
    rest = {p.name: p.default for p in effect.parameters if p not in fitted and p.default is not None}
    rest |= {
        p.name: p.held_at(characteristic_value(placed_dimension(effect, p.dimension), context.scales))
        for p in effect.parameters
        if not p.fitted
    }
    if effect.starts:
        for start in effect.starts:
            origin = base if start.parent is None else parents.get(start.parent)
            if origin is not None and start.parent != effect.name:
                own = declared_values(
                    context.rig, effect, start.values, _known(origin, start.parent), context.scales
                )
                yield with_own_values(structure, effect, origin, {**rest, **own})
        return
    sizes = [characteristic_value(placed_dimension(effect, p.dimension), context.scales) for p in fitted]
    for combination in itertools.product(*(p.starts for p in fitted)):
        own = {p.name: c * size for p, c, size in zip(fitted, combination, sizes, strict=True)}
        yield with_own_values(structure, effect, base, {**rest, **own})


def restart_values(structure: Structure, effect: Effect, fit: FitResult) -> Iterator[dict[str, float]]:
    """Yield further start values for a fit with `effect` that may have stopped in a local minimum."""
    for moved in moved_starts(structure, effect, fit.values):
        yield {**carried_over(fit.values, fit.structure, structure), **moved}


def with_own_values(
    structure: Structure, effect: Effect, origin: FitResult, own: Mapping[str, float]
) -> dict[str, float]:
    """Return the values of a fit for a structure with an effect more, with own values of that effect and of the rig."""
    carried = carried_over(origin.values, origin.structure, structure)
    return {**carried, **in_structure(structure, effect, own)}


def sized(value: float, null: float, factor: float) -> float:
    """Return the value of a parameter that scales its effect by a factor relative to another value."""
    return null + factor * (value - null) if abs(null) < ENDLESS else value / factor


def _known(origin: FitResult, parent: str | None) -> dict[str, float]:
    """Return the values that a start's formulas may use: the rig's, and the parent effect's by their own names."""
    values = dict(origin.values)
    for effect in origin.structure.effects:
        if effect.name == parent:
            values |= origin.structure.values_of(effect, origin.values)
    return values
