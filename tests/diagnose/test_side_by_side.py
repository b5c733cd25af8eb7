"""Models that are fitted at the same time come out as if one after the other."""

from __future__ import annotations

import threading

from rigsight.diagnose.side_by_side import side_by_side
from rigsight.identify import IdleThreads


def test_results_come_in_the_order_of_the_items() -> None:
    for n_jobs in (1, 3):
        assert side_by_side(lambda x: x * x, range(7), n_jobs, IdleThreads(n_jobs)) == [
            0,
            1,
            4,
            9,
            16,
            25,
            36,
        ]


def test_jobs_that_have_an_item_do_not_help_with_another() -> None:
    threads = IdleThreads(2)
    begun = threading.Barrier(2, timeout=60.0)
    ended = threading.Barrier(2, timeout=60.0)

    def one(_: int) -> set[int]:
        begun.wait()
        made_by = set(threads.results(lambda _: threading.get_ident(), [1] * 5))
        ended.wait()
        return made_by - {threading.get_ident()}

    assert side_by_side(one, range(2), 2, threads) == [set(), set()]
