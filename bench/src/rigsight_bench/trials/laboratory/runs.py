"""Records that a laboratory takes under each condition."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rigsight.records import Hold, Role
from rigsight.simulate import compose
from rigsight.simulate.linearization import linearize
from rigsight_bench.trials.any_rig_campaign import (
    DURATION,
    doublets,
    draw_amplitudes,
    draw_motion,
    in_proportion,
    multisines,
    sweeps,
)
from rigsight_bench.trials.laboratory.stands import GOAL, PUSH, STANDS, Law, wired_rig
from rigsight_bench.trials.laboratory.subjects import LaboratorySubject
from rigsight_bench.trials.runs import DT, Run
from rigsight_bench.trials.waveforms import PlannedMoves, Release, Sweep, Waveform

RUNNING_BEFORE = 3.0
"""Time [s] for which a rig runs before a record without rest begins."""
HELD_BEFORE = 0.2
"""Time [s] for which it is held before it is let go."""
_LOOP_BAND = (0.1, 1.5)
"""Of a goal, in units of the loop's bandwidth: beyond, it is not followed."""
_MOVE = 6.0
"""Time of a move in units of the reciprocal of the loop's bandwidth: one period of it."""
_REST_BEFORE_MOVES = (1.0, 3.0)
"""Time of rest before the first of them [s]: the time it takes to press start."""
_LET_GO: tuple[tuple[Role, float], ...] = (
    ("estimation", 1.0), ("estimation", 0.7), ("estimation", 0.45), ("estimation", 0.3),
    ("validation", 0.85), ("validation", 0.55),
)  # fmt: skip
"""Free decays: their role, and how far away they begin."""


def draw_laboratory_runs(
    subject: LaboratorySubject, values: Mapping[str, float], law: Law | None, rng: np.random.Generator
) -> tuple[Run, ...]:
    """Draw the records of a campaign. Each runs for `before` seconds that are not recorded.

    Parameters
    ----------
    subject
        Condition and stand.
    values
        The numbers of the stand.
    law
        Its control law; then the waveforms are those of the goal.
    rng
        Source of randomness.

    Raises
    ------
    SimulationError
        If the stand cannot be simulated.
    """
    rig = STANDS[subject.stand].rig
    if subject.condition == "free_decay":
        return _decays(subject, values, rng)
    if law is not None:
        amplitudes = {GOAL: draw_motion(rng)}
        band = _LOOP_BAND[0] * law.bandwidth, _LOOP_BAND[1] * law.bandwidth
    else:
        amplitudes, band = draw_amplitudes(rig, values, rng)
    # Between samples the output of a controller is smooth, whatever its goal.
    smooth: Hold = "foh" if law is not None else "band_limited"
    duration = DURATION + before(subject)
    n_samples = round(duration / DT)

    def sweep(name: str, role: Role, share: float) -> Run:
        waves = in_proportion(sweeps(amplitudes, band, rng, duration), share)
        return Run(name, role, "sweep", smooth, waves, n_samples)

    def multisine(name: str, role: Role, share: float) -> Run:
        waves = in_proportion(multisines(amplitudes, band, rng), share)
        return Run(name, role, "multisine", smooth, waves, n_samples)

    def step(name: str, role: Role, share: float) -> Run:
        if law is not None:
            return Run(name, role, "operation", smooth, _moves(share * amplitudes[GOAL], law, rng), n_samples)
        waves = in_proportion(doublets(amplitudes, band, rng), share)
        return Run(name, role, "step", "zoh", waves, n_samples)

    first = (sweep("record_1", "estimation", 0.4), sweep("record_2", "estimation", 1.0))
    last = (multisine("record_5", "validation", 0.7), sweep("record_6", "validation", 0.75))
    if subject.condition == "repeats":
        twice = multisine("record_3", "estimation", 0.8)
        return (*first, twice, replace(twice, name="record_4"), *last, replace(last[0], name="record_7"))
    if subject.condition == "antialias_filter":
        # A step has a rest before it.
        return (
            *first,
            multisine("record_3", "estimation", 0.6),
            multisine("record_4", "estimation", 0.8),
            *last,
        )
    # A prescribed motion cannot jump.
    third = step if rig.is_driven else multisine
    return (*first, third("record_3", "estimation", 0.6), multisine("record_4", "estimation", 0.8), *last)


def _moves(amplitude: float, law: Law, rng: np.random.Generator) -> dict[str, Waveform]:
    """Return moves from rest to rest: a goal that jumps has the drive jump between two samples, where no record shows it."""
    length = _MOVE / law.bandwidth
    return {GOAL: PlannedMoves(amplitude, rng.uniform(*_REST_BEFORE_MOVES), length)}


def before(subject: LaboratorySubject) -> float:
    """Return how long a rig runs or is held before its record begins [s]."""
    return {"antialias_filter": RUNNING_BEFORE, "free_decay": HELD_BEFORE}.get(subject.condition, 0.0)


def _decays(
    subject: LaboratorySubject, values: Mapping[str, float], rng: np.random.Generator
) -> tuple[Run, ...]:
    """Return decays: a force holds the last joint away from its rest, and lets go; no input moves."""
    rig = STANDS[subject.stand].rig
    found = linearize(compose(wired_rig(rig, None, None)), values)
    static = np.abs(np.real(found.frequency_response(np.zeros(1))[0, :, found.inputs.index(PUSH)]))
    force = draw_motion(rng) / float(np.max(static)) * rng.choice([-1.0, 1.0])
    still = {name: Sweep(0.0, 1.0, 2.0, DURATION) for name in rig.mechanism.inputs}
    # Just before a sample: the first of the record is that of a rig that is free.
    at = HELD_BEFORE * (1.0 - 1e-6)
    return tuple(
        Run(
            f"record_{number}",
            role,
            "operation",
            "zoh",
            {**still, PUSH: Release(share * math.exp(rng.uniform(-0.1, 0.1)) * force, at)},
            round((DURATION + HELD_BEFORE) / DT),
        )
        for number, (role, share) in enumerate(_LET_GO, 1)
    )
