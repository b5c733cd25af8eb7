"""Which time shifts say the same as a late sensor?

A reading that is late by its time base and one that is late by its sensor obey one equation; only an early one is surely a shift.
"""

from __future__ import annotations

from collections.abc import Sequence

from rigsight.diagnose.fitting.fit_context import Scored
from rigsight.effects import Effect


def without_late_shifts(models: Sequence[Scored]) -> list[Scored]:
    """Return the models without those whose shift is late where the same model with a late sensor in its place is among them.

    Parameters
    ----------
    models
        Of one or several effects, fitted and scored.
    """
    with_late_sensor = {
        _but(model, effect) for model in models for effect in model.effects if _is_late(effect)
    }

    def says_the_same(model: Scored) -> bool:
        return any(
            _shift(model, effect) > 0.0 and _but(model, effect) in with_late_sensor
            for effect in model.effects
            if effect.shifts_the_record
        )

    return [model for model in models if not says_the_same(model)]


def _is_late(effect: Effect) -> bool:
    return effect.measured_late is not None and not effect.shifts_the_record


def _but(model: Scored, effect: Effect) -> tuple[frozenset[str], str | None]:
    """Return the names of the other effects, and where this one acts."""
    return frozenset(model.names) - {effect.name}, effect.at


def _shift(model: Scored, effect: Effect) -> float:
    """Return the time by which an effect shifts the record [s]."""
    return sum(model.fit.structure.values_of(effect, model.fit.values).values())
