"""A force that comes back with the position is found over the position, at whatever speed the motion passes."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.search.starts import Run, position_lines

DT = 0.01
T = DT * np.arange(3000)


def law(way: np.ndarray, wave_number: float) -> list[np.ndarray]:
    return [np.sin(wave_number * way), np.cos(wave_number * way)]


def runs(wave_number: float, rng: np.random.Generator) -> list[Run]:
    """A mass whose way is known, moved a little by the force, with a drift and noise ten times as large."""
    found = []
    for rate in (0.7, 1.3):
        way = np.sin(rate * T) + 0.4 * np.sin(2.7 * rate * T)
        force = 0.3 * np.sin(wave_number * way) + 0.4 * np.cos(wave_number * way)
        moved = np.cumsum(np.cumsum(force - np.mean(force))) * DT**2
        left = moved + 1e-2 * T + 1e-3 * rng.standard_normal(T.size)
        found.append(Run(way, left, DT))
    return found


@pytest.mark.parametrize("wave_number", [9.3, 31.0, 66.0])
def test_the_wave_number_is_found_with_its_parts(wave_number: float) -> None:
    (best, *_) = position_lines(
        law, runs(wave_number, np.random.default_rng(2)), lambda omega: -1.0 / (omega**2 + 0j)
    )
    half_a_wave = np.pi / 2.8
    assert abs(best.wave_number - wave_number) < 0.5 * half_a_wave
    assert np.hypot(*best.coefficients) == pytest.approx(0.5, rel=0.5)


def test_a_way_that_never_moves_has_no_line() -> None:
    still = [Run(np.ones(300), np.random.default_rng(0).standard_normal(300), DT)]
    assert position_lines(law, still, lambda omega: np.ones(omega.size, dtype=complex)) == []
    assert position_lines(law, [], lambda omega: np.ones(omega.size, dtype=complex)) == []


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200, np.finfo(float).max])
def test_a_run_that_diverges_has_no_line(bad: float) -> None:
    def answer(omega: np.ndarray) -> np.ndarray:
        return -1.0 / (omega**2 + 0j)

    first, second = runs(31.0, np.random.default_rng(2))
    diverged = Run(first.way, np.where(T > 20.0, bad, first.remainder), DT)
    lost = Run(np.where(T > 20.0, np.nan, first.way), first.remainder, DT)
    assert position_lines(law, [diverged, lost], answer) == []
    assert position_lines(law, [diverged, second, lost], answer) == position_lines(law, [second], answer)
