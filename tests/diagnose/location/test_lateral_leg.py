from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.location.paths import fit_lateral_leg
from rigsight.metrics import rms
from rigsight.records import Record
from rigsight.rigs import AXIS, RUNNING_GEAR

DT = 5e-3
T = DT * np.arange(3000)
VALUES = {"v": 1.0, "l_0": 0.25, "c_y": 0.98, "y_off": 1e-3, "psi_off": 0.0}
RATE = VALUES["v"] * VALUES["c_y"] / (2.0 * VALUES["l_0"])


def motion(t: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(0.02 * np.sin(3.0 * t + 0.4) + 0.01 * np.sin(9.0 * t))


def lateral(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """The settled answer in closed form: each sine by the gain and phase of the thesis's PT1."""
    answer = np.full(t.size, VALUES["y_off"])
    for size, omega, phase in ((0.02, 3.0, 0.4), (0.01, 9.0, 0.0)):
        response = VALUES["v"] * VALUES["c_y"] / (1j * omega + RATE)
        answer = answer + size * np.imag(response * np.exp(1j * (omega * t + phase)))
    return answer


def context(psi: NDArray[np.float64], y: NDArray[np.float64], noise: Mapping[str, float]) -> FitContext:
    rng = np.random.default_rng(0)
    records = []
    for name, role in (("a", "estimation"), ("b", "validation")):
        signals = {
            "u": np.zeros(T.size),
            "psi": psi + noise["psi"] * rng.standard_normal(T.size),
            "y": y + noise["y"] * rng.standard_normal(T.size),
        }
        records.append(Record(name=name, dt=DT, signals=signals, units={}, role=role))  # type: ignore[arg-type]
    fitted, scored = records
    return FitContext(RUNNING_GEAR, (fitted,), (scored,), (fitted,), {}, noise, frozenset())


NOISE = {"psi": 2e-5, "y": 1e-5}


def test_the_given_numbers_leave_the_noise_where_they_are_right() -> None:
    leg = fit_lateral_leg(context(motion(T), lateral(T), NOISE), VALUES)
    assert leg is not None
    floor = np.hypot(NOISE["y"], leg.noise_gain * NOISE["psi"])
    assert rms(leg.given[0]) == pytest.approx(floor, rel=0.1)
    assert rms(leg.fitted[0]) == pytest.approx(floor, rel=0.1)


def test_wrong_numbers_are_fitted() -> None:
    leg = fit_lateral_leg(context(motion(T), lateral(T), NOISE), {**VALUES, "c_y": 0.7, "y_off": 0.0})
    assert leg is not None
    assert rms(leg.given[0]) > 50.0 * rms(leg.fitted[0])


@pytest.mark.parametrize("delay", [0.012, -0.012])
def test_a_late_sensor_shows_as_a_shift_of_its_sign(delay: float) -> None:
    """Late psi (positive) needs psi from later samples; late y the other way round."""
    late_psi, late_y = max(delay, 0.0), max(-delay, 0.0)
    leg = fit_lateral_leg(context(motion(T - late_psi), lateral(T - late_y), NOISE), VALUES)
    assert leg is not None
    assert leg.shift == pytest.approx(delay, abs=5.0 * leg.shift_std)
    assert leg.shift_std < 0.002
    assert rms(leg.shifted[0]) < 1.1 * np.hypot(NOISE["y"], leg.noise_gain * NOISE["psi"])


def test_what_delays_the_motion_itself_leaves_the_leg_alone() -> None:
    leg = fit_lateral_leg(context(motion(T - 0.05), lateral(T - 0.05), NOISE), VALUES)
    assert leg is not None
    assert abs(leg.shift) < 5.0 * leg.shift_std


def test_the_noise_of_the_motion_is_propagated() -> None:
    """With a noisy motion sensor alone, what is left of y is that noise behind the PT1."""
    noise = {"psi": 1e-3, "y": 1e-9}
    leg = fit_lateral_leg(context(motion(T), lateral(T), noise), VALUES)
    assert leg is not None
    assert rms(leg.given[0]) == pytest.approx(leg.noise_gain * noise["psi"], rel=0.35)


def test_a_rig_without_a_lateral_part_has_no_such_leg() -> None:
    record = Record(name="a", dt=DT, signals={"u": T, "x": T}, units={})
    axis = FitContext(AXIS, (record,), (record,), (record,), {}, {"x": 1.0}, frozenset())
    assert fit_lateral_leg(axis, {}) is None
    gear = Record(name="a", dt=DT, signals={"u": T, "psi": T}, units={})
    assert (
        fit_lateral_leg(FitContext(RUNNING_GEAR, (gear,), (gear,), (gear,), {}, {}, frozenset()), VALUES)
        is None
    )
