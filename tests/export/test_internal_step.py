"""The internal step follows from the model's own time scales."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.export.fixed_step import LONGEST, OSCILLATION, internal_step
from rigsight.simulate.model import Model


def with_values(model: Model, **values: float) -> Model:
    return replace(model, values={**model.values, **values})


def test_it_is_a_share_of_the_oscillation(case_named):
    model = case_named("linear axis").model
    omega = np.sqrt(model.values["k"] / model.values["m"])
    assert internal_step(model) == pytest.approx(OSCILLATION / omega, rel=0.1)


def test_four_times_the_stiffness_halves_it(case_named):
    model = case_named("linear axis").model
    assert internal_step(with_values(model, k=400.0)) == pytest.approx(0.5 * internal_step(model), rel=0.1)


@pytest.mark.parametrize(
    ("name", "stiff"),
    [("end_stop", {"k_s": 1e5}), ("sensor_lag", {"T_m": 1e-4}), ("flexible_mode", {"w_a": 500.0})],
)
def test_what_is_stiffer_than_the_rig_shortens_it(name: str, stiff: dict[str, float], case_named):
    model = case_named(name).model
    assert internal_step(with_values(model, **stiff)) < 0.3 * internal_step(model)


def test_a_model_without_motion_of_its_own_leaves_it_to_the_sample_time(case_named):
    assert internal_step(case_named("element").model) == LONGEST
