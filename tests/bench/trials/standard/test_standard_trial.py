"""A trial follows from its number alone, and hides what its key says."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate
from rigsight_bench.trials import Trial, draw_trial, n_trials
from rigsight_bench.trials.kinds import TIERS
from rigsight_bench.trials.standard.campaign import LinearRig, draw_rig
from rigsight_bench.trials.standard.subjects import Subject, standard_subject_of

SEED = 4711
"""The seed of tests/bench/test_benches.py, which then needs no trial of its own."""


def first_trial(fits: Callable[[Subject], bool]) -> int:
    return next(t for t in range(n_trials("standard")) if fits(standard_subject_of(SEED, t)))


@pytest.fixture(scope="module")
def cubic(drawn: Callable[[int, int], Trial]) -> Trial:
    return drawn(SEED, first_trial(lambda s: s.effects == ("cubic_stiffness",) and s.tier == "clear"))


@pytest.fixture(scope="module")
def nothing(drawn: Callable[[int, int], Trial]) -> Trial:
    return drawn(SEED, first_trial(lambda s: s.kind == "none"))


@pytest.mark.slow
def test_a_trial_drawn_twice_is_the_same(nothing: Trial) -> None:
    again = draw_trial("standard", SEED, nothing.key["trial"])
    assert again.key == nothing.key
    assert again.given == nothing.given
    first, second = (*nothing.records, *nothing.withheld), (*again.records, *again.withheld)
    for one, other in zip(first, second, strict=True):
        assert all(np.array_equal(one[name], other[name]) for name in one.signals)


@pytest.mark.slow
def test_a_hidden_effect_leaves_a_gap_of_about_the_wished_size(cubic: Trial) -> None:
    low, high = TIERS["clear"]
    assert low / 2.0 < cubic.key["gap"] < high * 1.5
    assert cubic.key["where"] in (["yaw_dynamics"], ["dynamics"])
    assert cubic.key["values"]["k_3"] != 0.0


@pytest.mark.slow
def test_the_given_simulation_fits_the_one_sweep_it_was_identified_from_and_no_other_as_well(
    cubic: Trial,
) -> None:
    output = cubic.rig.outputs[0].name
    errors = []
    for record in (r for r in cubic.records if r.kind == "sweep"):
        simulated = simulate(compose(cubic.rig), {**cubic.values, **cubic.given}, record)
        left = np.sqrt(np.mean((record[output] - simulated[output]) ** 2))
        errors.append(left / cubic.key["noise_floor"][output])
    assert max(errors) > 3.0
    assert min(errors) < 0.3 * max(errors)


@pytest.mark.slow
def test_without_an_effect_nothing_but_noise_is_left(nothing: Trial) -> None:
    assert nothing.key["gap"] == pytest.approx(1.0, abs=0.05)
    for name in ("J_z", "k_c", "k_d", "m", "d", "k"):
        if name in nothing.given:
            assert nothing.given[name] == pytest.approx(nothing.key["values"][name], rel=0.01)


@pytest.mark.slow
def test_wrong_parameters_are_off_by_what_a_data_sheet_is(cubic: Trial) -> None:
    trial = draw_trial("standard", SEED, first_trial(lambda s: s.kind == "parameters"))
    assert trial.key["gap"] == pytest.approx(1.0, abs=0.05)
    off = [
        abs(value / trial.key["values"][name] - 1.0)
        for name, value in trial.given.items()
        if trial.key["values"][name] != 0.0 and not name.endswith("_off")
    ]
    assert all(0.049 < error < 0.201 for error in off)


@pytest.mark.slow
def test_records_look_alike_whatever_is_hidden(cubic: Trial, nothing: Trial) -> None:
    for one, two in zip(cubic.records, nothing.records, strict=True):
        assert (one.name, one.role, one.kind, one.hold, one.n_samples, one.dt) == (
            two.name, two.role, two.kind, two.hold, two.n_samples, two.dt,
        )  # fmt: skip


def test_the_weights_sine_gets_an_axis_that_swings_wide() -> None:
    """On a running gear that turns by milliradians it is a cube, and leaves no gap at all."""
    rigs = [draw_rig(np.random.default_rng(seed), None, swings_wide=True) for seed in range(20)]
    assert {linear.rig.name for linear in rigs} == {"axis"}


def test_half_of_the_axes_swing_wide_whatever_is_hidden() -> None:
    axes = [draw_rig(np.random.default_rng(seed), AXIS, swings_wide=False) for seed in range(200)]
    wide = [axis for axis in axes if _swing(axis) >= 0.7]
    assert 75 < len(wide) < 125
    pendulums = [draw_rig(np.random.default_rng(seed), AXIS, swings_wide=True) for seed in range(200)]
    assert all(_swing(axis) >= 0.7 for axis in pendulums)
    for one, other in zip(wide, (p for p, a in zip(pendulums, axes, strict=True) if a in wide), strict=True):
        assert one.values == other.values


def _swing(axis: LinearRig) -> float:
    """Return the displacement at resonance that an input of one drives."""
    return axis.drive_gain / (axis.omega * axis.values["d"])
