"""Preparation of the fits of a task: records, scales, start values, and which parameters are held."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from rigsight.diagnose.fitting.fit_context import FitContext, liveliest, until_rest
from rigsight.diagnose.fitting.task import Task
from rigsight.diagnose.fitting.windows import Windowing
from rigsight.identify import (
    FitMemory,
    IdleThreads,
    characteristic_scales,
    linear_start,
    swallowed_by_offsets,
)
from rigsight.simulate import Structure, compose

Prepare = Callable[[Sequence[Structure]], None]
"""Called with the structures that are about to be simulated, to compile them side by side."""


def fit_context_of(
    task: Task,
    noise: Mapping[str, float],
    windowing: Windowing,
    memory: FitMemory | None,
    threads: IdleThreads,
) -> FitContext:
    """Return the context in which candidates of a task are fitted and scored.

    Parameters
    ----------
    task
        Records and the simulation in question.
    noise
        Noise floor of each output.
    windowing
        How to cut records.
    memory, threads
        As of `FitContext`.
    """
    start = start_values_of(task)
    fitted = windowing.cut(task.estimation)
    moving = until_rest(fitted, task.rig)
    held = _held(task)
    asked = [p.name for p in task.rig.parameters if p.name not in held]
    scales = characteristic_scales(task.rig, task.estimation, start)
    held |= frozenset(swallowed_by_offsets(compose(task.rig), task.estimation, scales, noise, start, asked))
    return FitContext(
        rig=task.rig,
        estimation=fitted,
        look=liveliest(moving, task.rig),
        scoring=windowing.cut(task.validation or task.estimation),
        scales=scales,
        noise=noise,
        held=held,
        start=start,
        given=task.given,
        modelled=task.modelled,
        memory=memory,
        threads=threads,
    )


def start_values_of(task: Task) -> dict[str, float]:
    """Return values of all constants and parameters before any fit."""
    held = {} if task.absent_spring is None else {task.absent_spring: 0.0}
    if task.open_factor is not None:
        held[task.open_factor.held] = task.open_factor.value
    start = {**task.constants, **linear_start(task.rig, task.estimation, task.constants, held)}
    # Numbers fitted without the effects that the simulation has are farther off than those it came with.
    return {**start, **task.given} if task.modelled or task.rig.mechanism.bodies_are_nonlinear else start


def _held(task: Task) -> frozenset[str]:
    """Return rig parameters that these records do not determine, and the stiffness of an absent spring."""
    held = set() if task.absent_spring is None else {task.absent_spring}
    if task.open_factor is not None:
        held.add(task.open_factor.held)
    if not task.rig.has_one_motion:
        return frozenset(held)
    unmeasured = [
        symbol
        for symbol in task.rig.downstream
        if not any(symbol.name in record for record in task.estimation)
    ]
    if unmeasured:
        held |= task.rig.downstream_parameters
    return frozenset(held)
