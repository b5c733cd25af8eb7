"""Distribution of threads: idle threads help with the records of a running fit.

Candidates are fitted in parallel as long as there are at least as many of them as jobs. Otherwise, and if one takes much longer
than the others, idle jobs take a share of the records of a running fit; this works because simulations release the interpreter
lock. The results and the order of summation do not depend on the number of jobs.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


class IdleThreads:
    """The threads of a number of jobs: at most so many compute at the same time, including the calling one."""

    def __init__(self, n_jobs: int = 1) -> None:
        self._n_jobs = n_jobs
        self._lock = threading.Lock()
        self._busy = 0
        # Threads are started when they are first needed, and end with their last reference.
        self._pool = ThreadPoolExecutor(n_jobs - 1) if n_jobs > 1 else None

    @contextmanager
    def one_busy(self) -> Iterator[None]:
        """Count the calling thread as busy while it works on a fit of its own, in parallel with others."""
        with self._lock:
            self._busy += 1
        try:
            yield
        finally:
            with self._lock:
                self._busy -= 1

    def side_by_side(self, one: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """Yield the results of a function for each item, in order; threads without an item help with the records of others."""
        if self._n_jobs == 1:
            yield from map(one, items)
            return
        # Not above: one thread does not need it, and it takes a tenth of a second to load.
        from joblib import Parallel, delayed

        def counted(item: Item) -> Result:
            with self.one_busy():
                return one(item)

        parallel = Parallel(n_jobs=self._n_jobs, prefer="threads", return_as="generator")
        yield from parallel(delayed(counted)(item) for item in items)

    def results(self, one: Callable[[int], Result], sizes: Sequence[int]) -> list[Result]:
        """Return the results of a function for the numbers ``0, 1, ...``, in order; `sizes` is the amount of work of each."""
        return self.results_of_shares(lambda numbers: [one(number) for number in numbers], sizes)

    def results_of_shares(
        self, several: Callable[[Sequence[int]], Sequence[Result]], sizes: Sequence[int]
    ) -> list[Result]:
        """Return the same for a function that takes several numbers at once and returns its results in their order."""
        free = self._borrowed(len(sizes) - 1)
        if not free or self._pool is None:
            return list(several(range(len(sizes))))
        try:
            own, *others = _shares(sizes, 1 + free)
            waiting = [(share, self._pool.submit(several, share)) for share in others]
            found = dict(zip(own, several(own), strict=True))
            for share, helped in waiting:
                found.update(zip(share, helped.result(), strict=True))
        finally:
            with self._lock:
                self._busy -= free
        return [found[index] for index in range(len(sizes))]

    def _borrowed(self, most: int) -> int:
        """Count as many idle threads as can help as busy, and return their number."""
        with self._lock:
            # If no thread is counted, the calling one is the only one that works.
            free = max(0, min(most, self._n_jobs - max(1, self._busy)))
            self._busy += free
        return free


def _shares(sizes: Sequence[int], count: int) -> list[list[int]]:
    """Return the numbers in shares of about the same size: the largest first, each to the smallest share so far."""
    shares: list[list[int]] = [[] for _ in range(count)]
    loads = [0] * count
    for index in sorted(range(len(sizes)), key=lambda i: -sizes[i]):
        least = loads.index(min(loads))
        shares[least].append(index)
        loads[least] += sizes[index]
    return shares
