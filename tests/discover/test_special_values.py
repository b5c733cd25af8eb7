"""An exponent that is held at one may be released, whatever it is called beside other terms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from rigsight.discover.assembly import doubts
from rigsight.discover.bench import Attempt, Bench, Trial
from rigsight.discover.result import Coefficient
from rigsight.discover.selection import select
from rigsight.effects import effect_named
from rigsight.identify import FitResult
from rigsight.rigs import AXIS

LOOP = effect_named("bouc_wen_hysteresis")
POWER_LAW = effect_named("power_law_stiffness")


@pytest.fixture
def bench() -> Bench:
    """Return a bench of two terms, both with an exponent n."""
    scales = dict.fromkeys(("x", "time", "force", "drive"), 1.0)
    return Bench(AXIS, (), (), {}, scales, {}, frozenset(), {e.name: e for e in (LOOP, POWER_LAW)})


@pytest.mark.parametrize("support", [{LOOP.name}, {LOOP.name, POWER_LAW.name}])
def test_a_released_exponent_is_free(support: set[str], bench: Bench) -> None:
    held = bench.structure(frozenset(support))
    assert [value for _, value in held.fixed] == [1.0]
    released = bench.structure(frozenset(support), held.special_cases)
    assert released.fixed == ()
    exponent = released.parameter_name(LOOP, "n")
    assert exponent in bench.free_parameters(released)


def test_the_search_releases_exponents_of_one_name(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)

    def fitted(self: Bench, attempts: Sequence[Attempt], progress: Any = None) -> list[Trial]:
        for attempt in attempts:
            structure = self.structure(attempt.support, attempt.release)
            free = tuple(self.free_parameters(structure))
            fit = FitResult(structure, True, "", {}, {}, (), 1.0, 1, 1, free, np.eye(len(free)), ())
            error = 5.0 - len(attempt.support) - 0.5 * len(attempt.release)
            self.trials[attempt.key] = Trial(attempt.support, fit, error, rng.standard_normal((300, 1)))
        return [self.trials[attempt.key] for attempt in attempts]

    monkeypatch.setattr(Bench, "trials_of", fitted)
    monkeypatch.setattr(Bench, "shortened", lambda *_: [])
    (linear,) = bench.trials_of([Attempt(frozenset(), [])])
    best = select(bench, linear, None, lambda _: None).best
    assert best.support == {LOOP.name, POWER_LAW.name}
    assert best.fit.structure.fixed == ()


def test_what_a_longer_equation_released_is_released_in_a_shorter_one(bench: Bench) -> None:
    longer = bench.structure(frozenset({LOOP.name, POWER_LAW.name}))
    assert bench.structure(frozenset({LOOP.name}), longer.special_cases).fixed == ()


@pytest.mark.parametrize("name", ["n", "bouc_wen_hysteresis.n"])
def test_an_exponent_is_not_compared_with_zero(name: str) -> None:
    vague = {name: Coefficient(1.0, 0.5, "1")}
    assert doubts(LOOP, vague) == f"{name} is known to 50 % only"
