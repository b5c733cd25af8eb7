"""What has no size, is not determined, or is longer than the records can show cannot be the cause."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rigsight.diagnose.search.possible_cause import (
    has_size_of_zero,
    is_beyond_records,
    is_undetermined,
    leading,
)
from rigsight.records import Record
from rigsight.rigs import AXIS

from ..conftest import with_numbers


def record() -> Record:
    """Return 20 s of a motion that something drives."""
    t = 0.01 * np.arange(2001)
    return Record("driven", 0.01, {"u": np.sin(t), "x": np.sin(t)}, {})


def context() -> Any:
    """What is asked of the records: their duration, and the size and range of their motion."""
    scales = {"x": 1.0, "travel": 2.0, "time": 1.0}
    return SimpleNamespace(rig=AXIS, records=(record(),), scales=scales)


def test_an_effect_none_of_whose_numbers_the_records_determine_is_undetermined(friction_models) -> None:
    reidentified, coulomb, stribeck = friction_models
    assert not any(is_undetermined(model, reidentified) for model in (reidentified, coulomb, stribeck))
    errors = {**coulomb.fit.standard_errors, "T_c": np.inf}
    assert is_undetermined(replace(coulomb, fit=replace(coulomb.fit, standard_errors=errors)), reidentified)


def test_an_effect_that_opens_a_common_factor_is_undetermined_unless_it_is_open_without_it(
    friction_models,
) -> None:
    reidentified, coulomb, _ = friction_models
    beside = replace(coulomb.fit, standard_errors=dict.fromkeys(coulomb.fit.free, np.inf))
    opened = replace(coulomb, fit=beside)
    assert is_undetermined(opened, reidentified)
    without = replace(reidentified.fit, standard_errors=dict.fromkeys(reidentified.fit.free, np.inf))
    assert not is_undetermined(opened, replace(reidentified, fit=without))


@pytest.mark.parametrize(
    ("effect", "values", "beyond"),
    [
        # Less than one period of a ripple lies in the motion.
        ("torque_ripple", {"T_sin": 1.0, "T_cos": 0.1, "kappa": 3.0}, True),
        ("torque_ripple", {"T_sin": 1.0, "T_cos": 0.1, "kappa": 6.0}, False),
        ("maxwell_branch", {"k_m": 1.0, "tau_m": 30.0}, True),
        ("maxwell_branch", {"k_m": 1.0, "tau_m": 3.0}, False),
        ("flexible_mode", {"m_a": 78000.0, "w_a": 0.2, "zeta_a": 0.1}, True),
        ("periodic_disturbance", {"T_p": 1.0, "w_p": 0.6}, True),
        ("periodic_disturbance", {"T_p": 1.0, "w_p": 1.5}, False),
        # A mode starts from equilibrium, so that two of its periods say as much as they are.
        ("flexible_mode", {"m_a": 0.2, "w_a": 0.6, "zeta_a": 0.1}, False),
        ("presliding_friction", {"T_c": 1.0, "x_p": 20900.0}, True),
        ("coulomb_friction", {"T_c": 1.0}, False),
        # Over more than half of a record the reading would be that of its start.
        ("sensor_delay", {"T_s": 11.0}, True),
        ("sensor_delay", {"T_s": 9.0}, False),
        ("time_shift", {"T_x": -11.0}, True),
        ("sensor_lag", {"T_m": 11.0}, False),
    ],
)
def test_what_is_slower_or_longer_than_the_records_is_no_candidate(
    scored, effect: str, values: dict[str, float], beyond: bool
) -> None:
    model = with_numbers(scored((effect,)), values, dict.fromkeys(values, 0.1))
    assert is_beyond_records(model, context()) is beyond


@pytest.mark.parametrize(
    ("damping", "pulsation", "drive", "is_motion"),
    [
        (0.1, 5.1, 0.0, True),
        (0.1, 6.0, 0.0, False),
        # What lasts is driven, by the tone or by the input.
        (0.0, 5.0, 0.0, False),
        (0.1, 5.1, 1.0, False),
    ],
)
def test_a_tone_at_the_frequency_of_a_free_motion_that_decays_is_this_motion(
    scored, damping: float, pulsation: float, drive: float, is_motion: bool
) -> None:
    t = 0.01 * np.arange(2000)
    signals = {"u": drive * np.sin(3.0 * t), "x": np.exp(-damping * t) * np.cos(5.0 * t)}
    asked = SimpleNamespace(rig=AXIS, records=(Record("decay", 0.01, signals, {}),), scales={})
    tone = with_numbers(scored(("periodic_disturbance",)), {"T_p": 1.0, "w_p": pulsation}, {})
    assert is_beyond_records(tone, asked) is is_motion


@pytest.mark.parametrize(
    ("effect", "held_out", "has_none"),
    [
        ("coulomb_friction", 0.6, False),
        ("coulomb_friction", 0.8, True),
        ("maxwell_branch", 0.6, True),
    ],
)
def test_errors_of_a_size_do_not_count_against_what_held_out_records_show(
    scored, effect: str, held_out: float, has_none: bool
) -> None:
    """The larger part of the square is removed at 0.71; a branch has a state, which may start anywhere."""
    without = with_numbers(scored((), error_over_noise=20.0), {"m": 1.0}, {"m": 0.1})
    size = {"coulomb_friction": "T_c", "maxwell_branch": "k_m"}[effect]
    model = with_numbers(
        scored((effect,), residuals=np.full(9, held_out * 20.0)), {"m": 1.0, size: 1.0}, {"m": 0.1, size: 1.0}
    )
    fit = replace(model.fit, covariance=np.diag([0.01, 1.0]), cost=1.0, n_samples=100)
    model = replace(model, fit=fit)
    without = replace(without, fit=replace(without.fit, cost=400.0, n_samples=100))
    assert has_size_of_zero(model, [without]) is has_none


def test_what_is_slower_than_the_records_does_not_lead(scored) -> None:
    """It follows each of them by its free initial states."""
    mode = {"m_a": 2.0, "w_a": 0.2, "zeta_a": 0.1}
    slow = with_numbers(
        scored(("flexible_mode",), residuals=np.full(9, 5.0)), mode, dict.fromkeys(mode, 0.01)
    )
    fast = with_numbers(scored(("coulomb_friction",), residuals=np.full(9, 9.0)), {"T_c": 1.0}, {"T_c": 0.1})
    assert leading(context(), [slow, fast]) is fast
    assert leading(context(), [slow]) is slow
    assert leading(context(), []) is None
