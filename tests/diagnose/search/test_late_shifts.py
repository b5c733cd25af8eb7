"""A shift of the record that is late says what a late sensor says; an early one is a shift for sure."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rigsight.diagnose.fitting.fit_context import Scored
from rigsight.diagnose.search.late_shifts import without_late_shifts


def shifted(model: Scored, time: float) -> Scored:
    """Return a model with a time shift, shifted by so much."""
    fit = replace(model.fit, values={**dict.fromkeys(model.fit.structure.names, 1.0), "T_x": time})
    return replace(model, fit=fit)


@pytest.mark.parametrize("beside", [(), ("cubic_stiffness",)], ids=["alone", "beside another effect"])
@pytest.mark.parametrize(("time", "stays"), [(0.01, False), (-0.01, True)], ids=["late", "early"])
def test_only_an_early_shift_stands_beside_a_late_sensor(
    scored, beside: tuple[str, ...], time: float, stays: bool
) -> None:
    sensor = shifted(scored((*beside, "sensor_delay")), 0.0)
    shift = shifted(scored((*beside, "time_shift")), time)
    assert without_late_shifts([sensor, shift]) == ([sensor, shift] if stays else [sensor])


def test_a_late_shift_stays_where_no_late_sensor_was_tried_beside_the_same_effect(scored) -> None:
    sensor = shifted(scored(("coulomb_friction", "sensor_delay")), 0.0)
    shift = shifted(scored(("cubic_stiffness", "time_shift")), 0.01)
    assert without_late_shifts([sensor, shift]) == [sensor, shift]
