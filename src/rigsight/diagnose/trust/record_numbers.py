"""Which change of each number of the diagnosed simulation does each record ask for? A gate holds new records against it."""

from __future__ import annotations

from rigsight.compare import OwnNumber, own_numbers
from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.records import Hold
from rigsight.simulate.model import Model

RecordNumbers = dict[str, tuple[OwnNumber, ...]]
"""By the name of the record."""


def record_numbers(context: FitContext, model: FittedModel, hold: Hold) -> RecordNumbers:
    """Return the changes that the records ask for, one number at a time; nothing where an observer followed the motion."""
    if any(record.observed for record in context.records):
        return {}
    whole = Model.of(model.fit.structure, model.fit.values, hold)
    names = dict.fromkeys(record.origin for record in context.records)
    return {
        name: tuple(own_numbers(whole, [r for r in context.records if r.origin == name], context.noise))
        for name in names
    }
