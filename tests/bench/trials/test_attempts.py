"""A trial is drawn again until it can be used, and given up with the last reason."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import SimulationError
from rigsight_bench.trials.attempts import first_that_succeeds


def draws_after(failures: int):  # type: ignore[no-untyped-def]
    seen: list[float] = []

    def draw(streams: list[np.random.Generator]) -> list[float]:
        seen.append(streams[0].random())
        if len(seen) <= failures:
            raise SimulationError(f"attempt {len(seen)} leaves no gap")
        return seen

    return draw


def test_the_first_usable_draw_counts() -> None:
    seen = first_that_succeeds(draws_after(30), seed=4, trial=13)
    assert len(set(seen)) == 31
    assert seen == first_that_succeeds(draws_after(30), seed=4, trial=13)


def test_a_trial_that_never_works_is_named_with_the_last_reason() -> None:
    with pytest.raises(SimulationError, match=r"Trial 13 of seed 4 cannot be drawn: attempt \d+ leaves"):
        first_that_succeeds(draws_after(10**6), seed=4, trial=13)
