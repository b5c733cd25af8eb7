"""Models that are equivalent to a simpler one are left out, also in combination with other effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import VERDICT
from rigsight.effects import Effect
from rigsight.identify import FitResult


def without_repeated_equations(context: FitContext, models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the models without those that are equivalent to a simpler one among them."""
    return _without_late_shifts(_without_needless_means(context, models))


def _without_needless_means(context: FitContext, models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the models without those whose mean force is not needed.

    An effect with a mean force and a simpler one with a constant force obey the same equation. If the simpler one, with the same
    other effects, leaves the constant forces at their known values, the mean force is not needed.
    """
    fits = {frozenset(model.names): model.fit for model in models}

    def is_needed(model: FittedModel) -> bool:
        held = context.constant_forces_beside(model.effects)
        plainer = [
            fit
            for effect in model.effects
            if effect.holds_constant_force
            for parent in effect.parents
            if (fit := fits.get(frozenset(model.names) - {effect.name} | {parent})) is not None
        ]
        return not held or not plainer or any(_moves(context, fit, held) for fit in plainer)

    return [model for model in models if is_needed(model)]


def _moves(context: FitContext, fit: FitResult, known: Mapping[str, float]) -> bool:
    """Return True if a fit changes a known constant force by more than the errors of other given values."""
    defaults = {p.name: p.default for p in context.rig.parameters}
    estimated = {name: value for name, value in context.given.items() if value != defaults.get(name)}
    others = _moves_of(fit, {name: value for name, value in estimated.items() if name not in known})
    usual = max(1.0, float(np.sqrt(np.mean(np.square(list(others.values())))))) if others else 1.0
    return any(
        move > VERDICT.standard_errors * (usual if name in estimated else 1.0)
        for name, move in _moves_of(fit, known).items()
    )


def _moves_of(fit: FitResult, known: Mapping[str, float]) -> dict[str, float]:
    """Return the deviation of a fit from known values, in standard errors."""
    return {
        name: abs(fit.values[name] - value) / fit.standard_errors[name]
        for name, value in known.items()
        if name in fit.free and fit.standard_errors[name] > 0.0
    }


def _without_late_shifts(models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the models without late time shifts if the same model with a sensor delay instead is among them.

    A late time base and a sensor delay obey the same equation; only an early reading is certainly a time shift.
    """
    with_late_sensor = {
        _but(model, effect) for model in models for effect in model.effects if _is_late(effect)
    }

    def says_the_same(model: FittedModel) -> bool:
        return any(
            _shift(model, effect) > 0.0 and _but(model, effect) in with_late_sensor
            for effect in model.effects
            if effect.shifts_the_record
        )

    return [model for model in models if not says_the_same(model)]


def _is_late(effect: Effect) -> bool:
    return effect.reading_delay is not None and not effect.shifts_the_record


def _but(model: FittedModel, effect: Effect) -> tuple[frozenset[str], str | None]:
    """Return the names of the other effects, and where this one acts."""
    return frozenset(model.names) - {effect.name}, effect.at


def _shift(model: FittedModel, effect: Effect) -> float:
    """Return the time by which an effect shifts the record [s]."""
    return sum(model.fit.structure.values_of(effect, model.fit.values).values())
