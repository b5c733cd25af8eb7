"""The kernels that a diagnosis needs, and their compilation before it starts."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence

from joblib import Parallel, delayed

from rigsight.diagnose.fit_context import candidates_on
from rigsight.diagnose.search.screening import structures_of_shortlist
from rigsight.effects import Effect
from rigsight.errors import check_in_range
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose
from rigsight.simulate.compiled.kernel import compiled, kernel_of
from rigsight.workflow.run.progress import Listener, Stage, silent

COMPILING = "Compiling kernels (first time only)"
_MOST_JOBS = 1024


def checked_jobs(n_jobs: int | None) -> int:
    """Return the number of parallel jobs: one per processor that this process may use, unless it is given."""
    if n_jobs is not None:
        return int(check_in_range("The number of jobs", n_jobs, 1, _MOST_JOBS))
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def structures_to_try(
    rig: Rig, effects: Iterable[Effect], modelled: tuple[Effect, ...] = ()
) -> list[Structure]:
    """Return the structures that a diagnosis simulates first: as modelled, pushed at every place, and each effect by itself."""
    offered = candidates_on(rig, effects, modelled)
    return [compose(rig, modelled), *structures_of_shortlist(rig, offered, modelled)]


def prepare_kernels(structures: Sequence[Structure], n_jobs: int, listener: Listener = silent) -> None:
    """Compile the kernels that are not in the cache of this machine yet, several at a time."""
    missing = [structure for structure in structures if not compiled(structure)]
    if not missing:
        return
    stage = Stage(COMPILING, len(missing), listener)
    # Each compiler is its own process, so threads are enough to run several of them.
    parallel = Parallel(
        n_jobs=min(n_jobs, len(missing)), backend="threading", return_as="generator_unordered", batch_size=1
    )
    for name in parallel(delayed(_compile)(structure) for structure in missing):
        stage.finished(name)


def _compile(structure: Structure) -> str:
    kernel_of(structure)
    return ", ".join(structure.effect_names) or structure.rig.name
