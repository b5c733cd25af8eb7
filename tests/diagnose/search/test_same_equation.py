"""A model that obeys the equations of a plainer one is left out, alone and beside other effects."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from rigsight.diagnose.fit_context import FittedModel
from rigsight.diagnose.search.nested_models import without_repeated_equations
from rigsight.rigs import AXIS

NOTHING_KNOWN = SimpleNamespace(constant_forces_beside=lambda _: {})


def shifted(model: FittedModel, time: float) -> FittedModel:
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
    assert without_repeated_equations(NOTHING_KNOWN, [sensor, shift]) == (
        [sensor, shift] if stays else [sensor]
    )


def test_a_late_shift_stays_where_no_late_sensor_was_tried_beside_the_same_effect(scored) -> None:
    sensor = shifted(scored(("coulomb_friction", "sensor_delay")), 0.0)
    shift = shifted(scored(("cubic_stiffness", "time_shift")), 0.01)
    assert without_repeated_equations(NOTHING_KNOWN, [sensor, shift]) == [sensor, shift]


@pytest.mark.parametrize("beside", [(), ("asymmetric_stiffness",)], ids=["alone", "beside another effect"])
@pytest.mark.parametrize(("moved", "stays"), [(2.0, False), (4.0, True)], ids=["known", "moved"])
def test_a_mean_force_stands_only_where_the_plainer_effect_moves_a_known_force(
    scored, beside: tuple[str, ...], moved: float, stays: bool
) -> None:
    """Symmetric friction beside a constant force that is known is the whole of friction that differs each way."""
    force = 1.0
    context = SimpleNamespace(rig=AXIS, given={}, constant_forces_beside=lambda _: {"force_off": force})
    symmetric = scored((*beside, "coulomb_friction"))
    fit = replace(
        symmetric.fit,
        values={"force_off": force + 0.1 * moved},
        free=("force_off",),
        standard_errors={"force_off": 0.1},
    )
    symmetric = replace(symmetric, fit=fit)
    each_way = scored((*beside, "directional_friction"))
    kept = without_repeated_equations(context, [symmetric, each_way])
    assert kept == ([symmetric, each_way] if stays else [symmetric])
