"""Records and key of one trial of design ``laboratory``; everything follows from seed and number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace

import numpy as np

from rigsight.effects import Effect, kind_of
from rigsight.errors import SimulationError
from rigsight.records import Record
from rigsight_bench.trials.any_rig_numbers import draw_offsets, is_offset
from rigsight_bench.trials.attempts import first_that_succeeds
from rigsight_bench.trials.fitted import largest_left
from rigsight_bench.trials.kinds import SEVERAL
from rigsight_bench.trials.laboratory.bench import LaboratoryBench
from rigsight_bench.trials.laboratory.runs import draw_laboratory_runs
from rigsight_bench.trials.laboratory.stands import STANDS
from rigsight_bench.trials.laboratory.subjects import (
    LaboratorySubject,
    draw_laboratory_effects,
    laboratory_subject_of,
)
from rigsight_bench.trials.laboratory.surroundings import LEAST_BESIDE, draw_surroundings
from rigsight_bench.trials.strength import GAPS, draw_gap
from rigsight_bench.trials.trial import Trial, as_given, off_by

_NOISY = 1e-3
"""Noise in units of the reading's size from which a trial is called noisy: the middle of what is drawn."""
_BESIDE = (0.15, 0.5)
"""Gaps of two further effects, in units of that of the main one."""
_OFF = (0.02, 0.1)
"""How far the given numbers are off: what data sheets and drawings are worth."""
_WITHOUT_INPUTS = 0.5
"""Share of free decays that hold no column of an input."""


def draw_laboratory_trial(seed: int, trial: int) -> Trial:
    """Draw and measure one trial of design ``laboratory``.

    Parameters
    ----------
    seed
        Seed of the whole bench.
    trial
        Number of the trial.

    Raises
    ------
    SimulationError
        If no stand that was drawn can be simulated, or no effect causes a gap of the requested size.
    """
    subject = laboratory_subject_of(seed, trial)
    return first_that_succeeds(lambda streams: _drawn(subject, seed, trial, streams), seed, trial)


def _drawn(
    subject: LaboratorySubject, seed: int, trial: int, streams: Sequence[np.random.Generator]
) -> Trial:
    of_rig, of_effect, of_strength, of_surroundings, of_noise, of_given = streams
    rig = STANDS[subject.stand].rig
    effects = draw_laboratory_effects(subject, of_effect)
    bench = draw_bench(subject, of_rig, of_surroundings)
    still = bench.floor((), {}, _measured(bench, (), {}, of_noise))
    wishes = _wished_gaps(bench, still, len(effects), of_strength)
    own, sizes = bench.truth(effects, wishes, still, of_effect)
    seen = _measured(bench, effects, own, of_noise)
    floor = bench.floor(effects, own, seen)
    refit = bench.refit([r for r in seen if r.role == "estimation"])
    gap = largest_left(bench.scored(refit, [r for r in seen if r.role == "validation"]), floor)
    if gap < GAPS[0]:
        raise SimulationError(f"{', '.join(e.name for e in effects)} cause a gap of {gap:.2g} floors.")
    key = {
        "schema_version": 2,
        "design": "laboratory",
        "seed": seed,
        "trial": trial,
        "condition": subject.condition,
        "stand": subject.stand,
        "kind": "single" if len(effects) == 1 else SEVERAL,
        "effects": [kind_of(effect.name) for effect in effects],
        "where": [rig.where(effect) for effect in effects],
        "rig": rig.name,
        "noise": "low" if bench.around.noise < _NOISY else "high",
        "aimed_gap": wishes,
        "gap": gap,
        "gap_alone": [size.gap for size in sizes],
        "strengths": [size.strength for size in sizes],
        "values": {**bench.values, **own},
        "noise_floor": floor,
        "surroundings": asdict(bench.around),
    }
    given = _given(bench, of_given)
    return Trial(rig, bench.values, given, tuple(handed(bench, seen, of_given)), (), key)


def draw_bench(
    subject: LaboratorySubject, of_rig: np.random.Generator, of_surroundings: np.random.Generator
) -> LaboratoryBench:
    """Draw a stand with its numbers, its surroundings and its experiments.

    Parameters
    ----------
    subject
        Condition and stand.
    of_rig, of_surroundings
        Sources of randomness.

    Raises
    ------
    SimulationError
        If the stand cannot be simulated, or its loop is not stable.
    """
    stand = STANDS[subject.stand]
    values = stand.draw_numbers(of_rig)
    around = draw_surroundings(subject, values, of_surroundings)
    runs = draw_laboratory_runs(subject, values, around.law, of_rig)
    first = LaboratoryBench(subject, values, around, runs)
    quiet = [first.quiet((), {}, run) for run in runs if run.role == "estimation"]
    offsets = draw_offsets(stand.rig, quiet, values, of_rig)
    held = dict.fromkeys(stand.held, 0.0)
    return LaboratoryBench(subject, {**values, **offsets, **held}, around, runs)


def _wished_gaps(
    bench: LaboratoryBench, floor: Mapping[str, float], n_effects: int, rng: np.random.Generator
) -> list[float]:
    """Draw the gap of each effect in units of the floor, the main one first."""
    main = draw_gap(bench.sizes, floor, rng)
    beside = [max(rng.uniform(*_BESIDE) * main, LEAST_BESIDE) for _ in range(n_effects - 1)]
    return [main, *beside]


def _measured(
    bench: LaboratoryBench,
    effects: Sequence[Effect],
    own: Mapping[str, float],
    rng: np.random.Generator,
) -> list[Record]:
    return [bench.measured(effects, own, run, number, rng) for number, run in enumerate(bench.runs)]


def handed(bench: LaboratoryBench, seen: Sequence[Record], rng: np.random.Generator) -> list[Record]:
    """Return the records as a diagnosis gets them: with offsets by record, and where nothing drives perhaps without its column.

    Parameters
    ----------
    bench
        Of which they are.
    seen
        As `LaboratoryBench.measured` returns them.
    rng
        Source of randomness.
    """
    around, rig = bench.around, bench.rig
    found = list(seen)
    if around.offset:
        found = [
            record.with_signals(
                **{
                    name: record[name] + around.offset * bench.noise[name] * rng.normal()
                    for name in bench.noise
                }
            )
            for record in found
        ]
    # Some loggers write a channel that is not used, some do not.
    if bench.subject.condition == "free_decay" and rng.random() < _WITHOUT_INPUTS:
        inputs = {signal.name for signal in rig.inputs}
        found = [
            replace(r, signals={name: samples for name, samples in r.signals.items() if name not in inputs})
            for r in found
        ]
    return found


def _given(bench: LaboratoryBench, rng: np.random.Generator) -> dict[str, float]:
    """Return the given simulation: numbers from drawings, without the offsets that no drawing has."""
    off = off_by(bench.rig, _OFF, rng)
    return as_given(
        {p.name: 0.0 if is_offset(p) else bench.values[p.name] * off[p.name] for p in bench.rig.parameters}
    )
