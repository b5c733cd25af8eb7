"""Threads that have nothing else to do help, and the results are those of one thread."""

from __future__ import annotations

import threading

import pytest

from rigsight.identify import IdleThreads

PATIENCE = 60.0


@pytest.mark.parametrize("n_jobs", [1, 2, 5])
def test_results_come_in_order_whoever_makes_them(n_jobs: int) -> None:
    threads = IdleThreads(n_jobs)
    sizes = [5, 1, 900, 40, 40, 1, 7]
    assert threads.results(lambda index: 10 * index, sizes) == [0, 10, 20, 30, 40, 50, 60]
    assert threads.results(lambda index: index, []) == []


def test_an_idle_thread_works_at_the_same_time() -> None:
    both = threading.Barrier(2, timeout=PATIENCE)
    # Neither of the two ends before the other has begun.
    assert len(IdleThreads(2).results(lambda _: both.wait(), [1, 1])) == 2


def test_who_is_busy_does_not_help() -> None:
    threads = IdleThreads(2)
    with threads.one_busy(), threads.one_busy():
        made_by = set(threads.results(lambda _: threading.get_ident(), [1] * 8))
    assert made_by == {threading.get_ident()}
    with threads.one_busy():
        both = threading.Barrier(2, timeout=PATIENCE)
        assert len(threads.results(lambda _: both.wait(), [1, 1])) == 2


def test_an_error_is_raised_and_the_thread_is_free_again() -> None:
    threads = IdleThreads(2)
    with pytest.raises(ZeroDivisionError):
        threads.results(lambda index: 1 // index, [1, 1, 1])
    with pytest.raises(ZeroDivisionError):
        threads.results(lambda index: 1 // (index - 2), [9, 9, 1])
    both = threading.Barrier(2, timeout=PATIENCE)
    assert len(threads.results(lambda _: both.wait(), [1, 1])) == 2


@pytest.mark.parametrize("n_jobs", [1, 2, 5])
def test_models_that_are_fitted_side_by_side_come_in_order(n_jobs: int) -> None:
    threads = IdleThreads(n_jobs)
    assert list(threads.side_by_side(lambda model: model.upper(), "abcdefg")) == list("ABCDEFG")
    assert list(threads.side_by_side(str, [])) == []


def test_two_models_are_fitted_at_the_same_time_and_nobody_is_left_to_help() -> None:
    threads = IdleThreads(2)
    both = threading.Barrier(2, timeout=PATIENCE)

    def fitted(_: int) -> set[int]:
        both.wait()
        made_by = set(threads.results(lambda _: threading.get_ident(), [1] * 8))
        both.wait()
        return made_by

    first, second = threads.side_by_side(fitted, [0, 1])
    assert len(first) == len(second) == 1
    assert first != second


def test_a_model_that_fails_leaves_its_thread_free() -> None:
    threads = IdleThreads(2)
    with pytest.raises(ZeroDivisionError):
        list(threads.side_by_side(lambda index: 1 // index, [1, 0]))
    both = threading.Barrier(2, timeout=PATIENCE)
    assert len(threads.results(lambda _: both.wait(), [1, 1])) == 2


def test_jobs_that_have_a_model_do_not_help_with_another() -> None:
    threads = IdleThreads(2)
    begun = threading.Barrier(2, timeout=60.0)
    ended = threading.Barrier(2, timeout=60.0)

    def one(_: int) -> set[int]:
        begun.wait()
        made_by = set(threads.results(lambda _: threading.get_ident(), [1] * 5))
        ended.wait()
        return made_by - {threading.get_ident()}

    assert list(threads.side_by_side(one, range(2))) == [set(), set()]
