"""Records and key of one trial of design ``handwritten``; everything follows from seed and number."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rigsight.errors import SimulationError
from rigsight.identify import FitResult
from rigsight.records import Record
from rigsight.rigs import RIGS
from rigsight_bench.trials.any_rig_campaign import draw_amplitudes
from rigsight_bench.trials.any_rig_numbers import draw_numbers, draw_offsets
from rigsight_bench.trials.attempts import first_that_succeeds
from rigsight_bench.trials.fitted import largest_left
from rigsight_bench.trials.handwritten.bench import HandwrittenBench
from rigsight_bench.trials.handwritten.cells import Cell, handwritten_cell_of
from rigsight_bench.trials.handwritten.plan import draw_plan
from rigsight_bench.trials.handwritten.plants import PRESCRIBED
from rigsight_bench.trials.handwritten.shapes import draw_shape
from rigsight_bench.trials.strength import GAPS, draw_gap
from rigsight_bench.trials.trial import Trial, as_given, off_by

_NOISE = (2e-4, 5e-3)
"""Noise of a sensor in units of its reading's size: from an interferometer's (74 dB) to a cheap potentiometer's (46 dB)."""
_APART = 0.5
"""By how much the noises of two sensors differ: standard deviation of their logarithm."""
_NOISY = 1e-3
"""Noise from which a trial is called noisy: the middle of what is drawn."""
_OFF, _WRONG = (0.02, 0.1), (0.05, 0.2)
"""Errors of the given parameters: as of data sheets if an effect is hidden, larger if wrong parameters are the cause."""


def draw_handwritten_trial(seed: int, trial: int) -> Trial:
    """Draw and measure one trial of design ``handwritten``.

    Parameters
    ----------
    seed
        Seed of the whole bench.
    trial
        Number of the trial.

    Raises
    ------
    SimulationError
        If no plant that was drawn can be integrated, or no effect causes a gap of the requested size.
    """
    cell = handwritten_cell_of(seed, trial)
    return first_that_succeeds(lambda streams: _drawn(cell, seed, trial, streams), seed, trial)


def _drawn(cell: Cell, seed: int, trial: int, streams: Sequence[np.random.Generator]) -> Trial:
    of_rig, of_effect, of_strength, of_noise, of_given, _ = streams
    rig = RIGS[cell.rig]
    bench = draw_bench(cell, of_rig)
    hidden, wished = None, None
    if cell.effect:
        wished = draw_gap(bench.readings, bench.noise, of_strength)
        hidden = bench.sized(draw_shape(cell.effect, bench.sizes, of_effect), wished)
    own = None if hidden is None else hidden.values
    records = bench.measured(own, of_noise)
    roles = [recording.role for recording in bench.plan]
    seen = [record for record, role in zip(records, roles, strict=True) if role is not None]
    withheld = [record for record, role in zip(records, roles, strict=True) if role is None]
    refit = bench.refit([r for r in seen if r.role == "estimation"])
    gap = largest_left(bench.scored(refit, [r for r in seen if r.role == "validation"]), bench.noise)
    if cell.effect and gap < GAPS[0]:
        raise SimulationError(f"{cell.effect} causes a gap of {gap:.2g} noise floors.")
    key = {
        "schema_version": 2,
        "design": "handwritten",
        "seed": seed,
        "trial": trial,
        "kind": cell.kind,
        "effects": [cell.effect] if cell.effect else [],
        "where": [cell.place] if cell.effect else [],
        "rig": rig.name,
        "noise": "low" if np.mean(list(bench.noise_shares.values())) < _NOISY else "high",
        "aimed_tier": None,
        "aimed_gap": wished,
        "gap": gap,
        "strengths": [] if hidden is None else [hidden.strength],
        "values": {**bench.values, **_by_names_of_fit(cell, own or {})},
        "noise_floor": bench.noise,
        "sample_time": bench.plan[0].dt,
        "hold": next((r.hold for r in bench.plan if r.kind != "step"), "zoh"),
    }
    given = _given(bench, seen, refit, of_given)
    return Trial(rig, bench.values, given, tuple(seen), tuple(withheld), key)


def draw_bench(cell: Cell, rng: np.random.Generator) -> HandwrittenBench:
    """Draw a rig's numbers, its experiments and its noise.

    Parameters
    ----------
    cell
        What is hidden.
    rng
        Source of randomness.

    Raises
    ------
    SimulationError
        If no parameter values with plausible poles are found.
    """
    rig = RIGS[cell.rig]
    values = draw_numbers(rig, rng)
    amplitudes, band = draw_amplitudes(rig, values, rng)
    plan = draw_plan(amplitudes, band, rng, prescribed=cell.rig == PRESCRIBED)
    level = math.exp(rng.uniform(*np.log(_NOISE)))
    shares = {s.name: level * math.exp(rng.normal(scale=_APART)) for s in rig.outputs}
    first = HandwrittenBench(cell, values, plan, shares)
    offsets = draw_offsets(rig, first.linear, values, rng)
    held = {name: 0.0 for name in offsets if name not in first.free}
    return HandwrittenBench(cell, {**values, **offsets, **held}, plan, shares)


def _by_names_of_fit(cell: Cell, own: dict[str, float]) -> dict[str, float]:
    """Return the effect's parameters as results name them: with the effect where the rig has that name too."""
    taken = {p.name for p in (*RIGS[cell.rig].constants, *RIGS[cell.rig].parameters)}
    at = cell.effect if RIGS[cell.rig].has_one_motion else f"{cell.effect}@{cell.place}"
    return {f"{at}.{name}" if name in taken else name: value for name, value in own.items()}


def _given(
    bench: HandwrittenBench, seen: Sequence[Record], refit: FitResult, rng: np.random.Generator
) -> dict[str, float]:
    """Return the given simulation: fitted to one record or from a data sheet, well fitted, or with numbers that are off."""
    first = [r for r in seen if r.role == "estimation"][:2]
    one = first[int(rng.integers(len(first)))]
    ends = _WRONG if bench.cell.kind == "parameters" else _OFF
    off = off_by(bench.rig, ends, rng)
    fitted_to_one = rng.random() < 0.5
    if bench.cell.kind == "none":
        found = dict(refit.values)
    elif bench.cell.kind != "parameters" and fitted_to_one:
        found = dict(bench.refit([one]).values)
    else:
        found = {name: bench.values[name] * factor for name, factor in off.items()}
    return as_given({p.name: found[p.name] for p in bench.rig.parameters})
