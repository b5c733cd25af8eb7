"""How are many fits done at the same time, and what do those jobs do that have none left?"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from joblib import Parallel, delayed

from rigsight.identify import IdleThreads

Item = TypeVar("Item")
Result = TypeVar("Result")


def side_by_side(
    one: Callable[[Item], Result], items: Iterable[Item], n_jobs: int, threads: IdleThreads
) -> list[Result]:
    """Return what a function makes of each item, in their order.

    Parameters
    ----------
    one
        Fits one model.
    items
        Models.
    n_jobs
        How many are fitted at the same time.
    threads
        Told how many are at work: who has no model left helps with the records of the others.
    """
    if n_jobs == 1:
        return [one(item) for item in items]

    def counted(item: Item) -> Result:
        with threads.one_busy():
            return one(item)

    return list(Parallel(n_jobs=n_jobs, prefer="threads")(delayed(counted)(item) for item in items))
