"""Mass, damping and stiffness come back from the transfer functions that they make, with their errors."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse
from rigsight.identify import fit_frequency_response, physical_parameters
from rigsight.rigs import AXIS

OMEGA = np.geomspace(0.5, 100.0, 300)
GAIN, M, D, K = 3.0, 2.0, 5.0, 800.0


def measured(values: np.ndarray, seed: int, share: float = 0.01) -> FrequencyResponse:
    size = share * np.abs(values)
    rng = np.random.default_rng(seed)
    error = size * (rng.normal(size=values.size) + 1j * rng.normal(size=values.size)) / np.sqrt(2.0)
    return FrequencyResponse(OMEGA, values + error, "u", "x", "m/N", variance=size**2)


@pytest.mark.slow
def test_an_axis_returns_its_numbers_with_honest_errors() -> None:
    truth = GAIN / (K - M * OMEGA**2 + 1j * D * OMEGA)
    deviations = []
    for seed in range(40):
        found = physical_parameters(
            AXIS, fit_frequency_response(measured(truth, seed), "pt2"), {"gain": GAIN}
        )
        errors = found.standard_errors
        deviations.append([(found.values[n] - v) / errors[n] for n, v in (("m", M), ("d", D), ("k", K))])
    assert np.sqrt(np.mean(np.square(deviations))) == pytest.approx(1.0, abs=0.25)


def test_a_drive_that_counts_backward_is_told() -> None:
    truth = -GAIN / (K - M * OMEGA**2 + 1j * D * OMEGA)
    fit = fit_frequency_response(measured(truth, 1), "pt2")
    with pytest.raises(InputError, match="opposite sign"):
        physical_parameters(AXIS, fit, {"gain": GAIN})
    assert physical_parameters(AXIS, fit, {"gain": -GAIN}).values["k"] == pytest.approx(K, rel=0.01)
