from __future__ import annotations

import control
import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse

OMEGA = np.linspace(0.5, 40.0, 200)


def response(**changes: object) -> FrequencyResponse:
    given = {
        "omega": OMEGA,
        "values": 3.0 / (1.0 + 1j * OMEGA / 5.0) ** 3,
        "source": "u",
        "response": "psi",
        "unit": "rad/A",
        "variance": 1e-6 * OMEGA,
    }
    return FrequencyResponse(**{**given, **changes})


def test_a_lag_beyond_half_a_turn_is_one_falling_phase() -> None:
    lag = response()
    np.testing.assert_allclose(lag.phase, -3.0 * np.arctan(OMEGA / 5.0))
    np.testing.assert_allclose(10.0 ** (lag.magnitude_db / 20.0), lag.magnitude)


def test_a_whole_turn_away_from_another_curve_is_no_difference() -> None:
    lag = response()
    np.testing.assert_allclose(lag.phase_next_to(OMEGA[::4], lag.phase[::4] + 0.2), lag.phase)
    np.testing.assert_allclose(lag.phase_next_to(OMEGA, lag.phase - 2.0 * np.pi), lag.phase - 2.0 * np.pi)


def test_a_band_keeps_values_and_variance_together() -> None:
    part = response().band(10.0, 20.0)
    assert 10.0 <= part.omega[0] < part.omega[-1] <= 20.0
    np.testing.assert_allclose(part.variance, 1e-6 * part.omega)
    assert part.noise_variance is None
    with pytest.raises(InputError, match=r"no frequency from 100 to 200 rad/s; it reaches from 0\.5 to 40"):
        response().band(100.0, 200.0)


def test_python_control_sees_the_same_values() -> None:
    lag = response()
    data = lag.to_control()
    assert isinstance(data, control.FrequencyResponseData)
    np.testing.assert_allclose(np.squeeze(data(1j * lag.omega)), lag.values)
    assert (data.input_labels, data.output_labels) == (["u"], ["psi"])


@pytest.mark.parametrize(
    ("changes", "reported"),
    [
        ({"omega": OMEGA[::-1]}, "must increase"),
        ({"omega": OMEGA - 1.0}, "omega must not be negative"),
        ({"values": np.ones(3)}, r"values must have shape \(200,\), got \(3,\)"),
        ({"values": np.full(200, np.nan)}, r"values is not finite at 0\.5 rad/s"),
        ({"variance": -OMEGA}, "variance must not be negative"),
        ({"coherence": 1.0 + OMEGA}, "coherence must be at most 1"),
        ({"omega": 1.0}, "must have shape"),
    ],
)
def test_what_is_no_response_is_refused(changes: dict[str, object], reported: str) -> None:
    with pytest.raises(InputError, match=reported):
        response(**changes)


def test_values_cannot_be_changed_afterwards() -> None:
    values = np.ones(200, dtype=complex)
    kept = response(values=values)
    values[:] = 0.0
    assert np.all(kept.values == 1.0)
    with pytest.raises(ValueError, match="read-only"):
        kept.values[0] = 2.0
