"""Rivals of a usual size, for effects that no record shows: each in turn is the truth.

Where there are records, the readings of the truth are simulated in them, and all rivals are fitted to these. What is left of a
reading counts in units of what laws of real rigs err by. Their errors are no noise: they repeat with the motion, so that a record
counts once, however many samples it has.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.diagnose.search.starts import start_values
from rigsight.identify import Coordinates, FitResult
from rigsight.identify.fit.windows import Windowing, liveliest
from rigsight.inverse import LAW_ERROR
from rigsight.plan.rivals import OLD, REACH, Contest, Named, Remainder, Rival, Truth, contest_of, prepared
from rigsight.records import Floats, Record
from rigsight.simulate import record_values, simulate

_OF_SENSORS = 1e-3
"""Share of its reading that a sensor errs by at least (an assumption)."""


def truths_of_usual_size(
    campaign: Campaign,
    named: Sequence[Named],
    n_samples: int,
    records_count: bool,
    say: Callable[[str], None],
) -> list[Truth]:
    """Return each rival as the truth with the size at which a search for it would start, for a record of `n_samples`."""
    # The records give motion and noise. Where they count, as measured ones do, they tell of the rivals as well; else the planned
    # one is the first.
    moving = liveliest(campaign.estimation, campaign.rig, OLD)
    context, windowing = prepared(replace(campaign, records=moving))
    base = reidentify(context, context.start).fit
    plain = [_moved(record, base) for record in moving]
    usual = [_of_usual_size(context, one, base) for one in named]
    readings = [[_moved(record, fit) for record in plain] for fit in usual]
    # What one effect changes, the laws beside it may err by as well.
    shares = {name: max(_share_of_laws(plain, own, name) for own in readings) for name in context.noise}
    remainders = [_of_laws(context, own, shares, n_samples) for own in readings]
    if not records_count:
        return _before_records(context, windowing, named, usual, remainders)
    truths = []
    for one, fit, moved, remainder in zip(named, usual, readings, remainders, strict=True):
        rng = np.random.default_rng(0)
        noisy = tuple(_noisy(context, record, rng) for record in moved)
        contest = contest_of(replace(campaign, records=noisy), named, say, remainder)
        own = next(rival for rival in contest.rivals if rival.label == one.label)
        true = replace(own, fit=replace(own.fit, values={**own.fit.values, **fit.values}))
        truths.append(Truth(contest, true, 1.0 / len(named)))
    return truths


def _before_records(
    context: FitContext,
    windowing: Windowing,
    named: Sequence[Named],
    usual: Sequence[FitResult],
    remainders: Sequence[Remainder],
) -> list[Truth]:
    """Return truths of which no record tells: only the numbers of the rig are known, and no rival is more probable."""
    share, truths = 1.0 / len(named), []
    rivals = [
        Rival(one.label, fit, share, np.diag(_known(context, fit, only_rig=True)))
        for one, fit in zip(named, usual, strict=True)
    ]
    for rival, remainder in zip(rivals, remainders, strict=True):
        contest = Contest(context, windowing, (), context.noise, remainder, tuple(rivals))
        drawn = replace(rival, information=np.diag(_known(context, rival.fit, only_rig=False)))
        truths.append(Truth(contest, drawn, share))
    return truths


def _known(context: FitContext, fit: FitResult, only_rig: bool) -> Floats:
    """Return the information on each free number that is known to `REACH` of its value; zero for others."""
    coordinates = Coordinates.of(fit.structure, fit.free, fit.values, context.scales)
    place = np.abs(coordinates.from_values(fit.values))
    spread = REACH * np.where(coordinates.logarithmic | (place == 0.0), 1.0, place)
    of_rig = {p.name for p in context.rig.parameters}
    return np.array(
        [s**-2.0 if name in of_rig or not only_rig else 0.0 for s, name in zip(spread, fit.free, strict=True)]
    )


def _of_usual_size(context: FitContext, one: Named, base: FitResult) -> FitResult:
    # No record holds it yet: it starts where the planned one does, also without an effect.
    found = replace(base, cost=0.0, initial_states=())
    for number in range(len(one.effects)):
        effects = one.effects[: number + 1]
        structure = context.simplest(effects, found.structure)
        values = next(iter(start_values(context, structure, effects[-1], found, {})))
        free = context.free_parameters(structure)
        found = replace(found, structure=structure, values=values, free=tuple(free))
    return found


def _moved(record: Record, fit: FitResult) -> Record:
    """Return a record with the readings that a model predicts from rest."""
    return simulate(fit.structure, record_values(fit.structure, fit.values, record), record)


def _noisy(context: FitContext, record: Record, rng: np.random.Generator) -> Record:
    noise = {
        name: record[name] + floor * rng.standard_normal(record.n_samples)
        for name, floor in context.noise.items()
        if name in record
    }
    return record.with_signals(**noise)


def _share_of_laws(plain: Sequence[Record], moved: Sequence[Record], name: str) -> float:
    """Return what laws err by in a reading that an effect moved, of its standard deviation."""
    without, having = (_samples(records, name) for records in (plain, moved))
    return max(LAW_ERROR * float(np.std(having - without)) / (float(np.std(having)) or 1.0), _OF_SENSORS)


def _of_laws(
    context: FitContext, moved: Sequence[Record], shares: Mapping[str, float], n_samples: int
) -> Remainder:
    """Return what laws leave of readings, beside the noise of a whole record; it moves as the readings do."""
    columns = np.column_stack([_samples(moved, signal.name) for signal in context.rig.outputs])
    size = np.std(columns, axis=0)
    spectra = (columns - np.mean(columns, axis=0)) / np.where(size > 0.0, size, 1.0)
    floors = {name: floor / float(np.sqrt(n_samples)) for name, floor in context.noise.items()}
    return Remainder(floors, shares, float(n_samples), spectra)


def _samples(records: Sequence[Record], name: str) -> Floats:
    return np.concatenate(
        [record[name] if name in record else np.zeros(record.n_samples) for record in records]
    )
