"""Conicity: its formula, and what records can and cannot tell of it."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.excitation import log_sweep
from rigsight.identify import estimate_conicity
from rigsight.identify.transfer.conicity import conicity_slope, creep_factor
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import compose, simulate

CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
R_0, B = CONSTANTS["r_0"], CONSTANTS["b"]


def test_the_slope_of_the_creep_factor_is_its_derivative() -> None:
    for delta in (-0.1, 0.024, 0.3):
        numeric = (creep_factor(delta + 1e-6, R_0, B) - creep_factor(delta - 1e-6, R_0, B)) / 2e-6
        assert conicity_slope(delta, R_0, B) == pytest.approx(numeric, rel=1e-6)


def test_a_ten_percent_error_of_the_break_frequency_is_the_negative_conicity_of_the_thesis() -> None:
    nominal = creep_factor(0.024, R_0, B)
    thesis = creep_factor(-0.15, R_0, B)
    assert thesis / nominal == pytest.approx(1.09, abs=0.01)
    found = estimate_conicity(thesis, 0.05 * thesis, R_0, B)
    assert found.unbounded == pytest.approx(-0.15)
    assert found.value == 0.0
    assert found.interval is not None
    assert found.interval[0] == 0.0
    assert not found.determined
    # A break frequency known to 5 % leaves nominal, reference and zero alike possible.
    wide = estimate_conicity(nominal, 0.05 * nominal, R_0, B)
    assert wide.interval is not None
    assert wide.interval[0] == 0.0
    assert wide.interval[1] > 5.0 * 0.024
    assert "upper limit only" in wide.statement


@pytest.mark.parametrize(
    ("c_y", "error", "words", "determined"),
    [
        (creep_factor(0.05, R_0, B), 1e-3, "delta_0 = 0.05 rad", True),
        (creep_factor(0.05, R_0, B), 0.3, "do not determine", False),
        (creep_factor(0.05, R_0, B), np.inf, "do not determine", False),
        (1.05, 0.01, "no positive conicity", False),
        (1.5, 0.01, "no positive conicity", False),
        (0.5, 0.2, "wider than the range", False),
    ],
)
def test_the_statement_says_what_the_interval_means(
    c_y: float, error: float, words: str, determined: bool
) -> None:
    found = estimate_conicity(c_y, error, R_0, B)
    assert words in found.statement
    assert found.determined is determined
    assert found.value >= 0.0
    assert (found.interval is None) == (words == "no positive conicity")


@pytest.mark.parametrize("delta_0", [0.005, 0.024, 0.2])
def test_conicity_intervals_cover_also_near_the_bound(delta_0: float) -> None:
    truth, error = creep_factor(delta_0, R_0, B), 0.01
    draws = np.random.default_rng(2).normal(truth, error, 1000)
    intervals = [estimate_conicity(c, error, R_0, B).interval for c in draws]
    inside = np.mean([i is not None and i[0] <= delta_0 <= i[1] for i in intervals])
    # 95 % of 1000 draws: a standard deviation of 0.7 %.
    assert inside == pytest.approx(0.95, abs=0.021)


def test_a_conicity_needs_a_positive_creep_factor() -> None:
    with pytest.raises(InputError, match="c_y above 0"):
        estimate_conicity(-0.1, 0.1, R_0, B)


def test_every_output_sees_the_conicity_only_through_speed_times_creep_factor() -> None:
    """Why no other record helps: another conicity with another speed makes the same motion, offsets and steps included."""
    t = 5e-3 * np.arange(2000)
    record = Record(name="r", dt=5e-3, signals={"u": log_sweep(t, 1.0, 0.3, 60.0)}, units={})
    own = {"J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 1e-3, "l_0": 0.25, "y_off": -5e-4}
    flat, steep = creep_factor(0.0, R_0, B), creep_factor(0.1, R_0, B)
    first, second = (
        simulate(compose(RUNNING_GEAR), {**CONSTANTS, **own, "c_y": c, "v": v}, record)
        for c, v in ((flat, 1.0), (steep, flat / steep))
    )
    for name in ("psi", "y"):
        assert second[name] == pytest.approx(first[name], abs=1e-9 * np.max(np.abs(first[name])))
