"""Which kernels a diagnosis needs, and how are they compiled before it starts?"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterable, Sequence

from joblib import Parallel, delayed
from joblib.externals.loky import get_reusable_executor

from rigsight.effects import Effect
from rigsight.errors import check_in_range
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose
from rigsight.simulate.kernel_cache import ENTRY_POINTS
from rigsight.simulate.precompile import compile_kernels, compiled
from rigsight.workflow.parent_watch import end_with_parent
from rigsight.workflow.progress import Listener, Stage, silent

COMPILING = "Compiling kernels (first run on this machine only)"
COMPILING_PAIRS = "Compiling kernels of pairs (first time only)"
_MOST_JOBS = 1024


def checked_jobs(n_jobs: int | None) -> int:
    """Return the number of jobs to run side by side: one per processor that this process may use, unless it is given.

    Raises
    ------
    InputError
        If it is not between 1 and 1024.
    """
    if n_jobs is not None:
        return int(check_in_range("The number of jobs", n_jobs, 1, _MOST_JOBS))
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def structures_to_try(
    rig: Rig, effects: Iterable[Effect], modelled: tuple[Effect, ...] = ()
) -> list[Structure]:
    """Return the structures that a diagnosis simulates first: as modelled, and with each effect more that makes sense."""
    offered = [effect for effect in effects if rig.offers(effect) and effect not in modelled]
    return [
        compose(rig, modelled),
        *(compose(rig, (*modelled, effect), effect.special_cases) for effect in offered),
    ]


def prepare_kernels(
    structures: Sequence[Structure], n_jobs: int, listener: Listener = silent, for_looks: bool = False
) -> None:
    """Compile what this machine does not hold yet, several at a time.

    Parameters
    ----------
    structures
        What is going to be simulated.
    n_jobs
        Processes.
    listener
        Told of every compiled kernel; not at all where there is nothing to compile.
    for_looks
        Compile only what a first look at pairs of effects needs.

    Raises
    ------
    InputError
        If the cache folder cannot be written.
    """
    functions = ("simulate_lanes",) if for_looks else ENTRY_POINTS
    missing = [structure for structure in structures if not compiled(structure, functions)]
    if not missing:
        return
    stage = Stage(COMPILING_PAIRS if for_looks else COMPILING, len(missing), listener)
    n_jobs = min(n_jobs, len(missing))
    if n_jobs < 2:
        for structure in missing:
            compile_kernels(structure, for_looks)
            stage.finished(_described(structure))
        return
    # Processes that ignore Ctrl-C do not each print a traceback; joblib ends them when this process is interrupted.
    parallel = Parallel(
        n_jobs=n_jobs,
        backend="loky",
        return_as="generator_unordered",
        batch_size=1,
        initializer=_left_to_parent,
    )
    try:
        for name in parallel(delayed(_compile)(structure, for_looks) for structure in missing):
            stage.finished(name)
    finally:
        # Idle workers would keep half a gigabyte each for minutes.
        get_reusable_executor(reuse=True).shutdown(kill_workers=True)


def _compile(structure: Structure, for_looks: bool) -> str:
    compile_kernels(structure, for_looks)
    return _described(structure)


def _left_to_parent() -> None:
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _described(structure: Structure) -> str:
    return ", ".join(structure.effect_names) or structure.rig.name
