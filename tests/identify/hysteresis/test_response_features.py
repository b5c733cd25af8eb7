"""Features of frequency responses, and the response of a sweep, against the closed form of a linear rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.excitation import log_sweep
from rigsight.frequency import FrequencyResponse
from rigsight.identify.hysteresis import SpectralRatio, break_frequency, fitted_break_frequency, peak
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.rigs.published import published_sets
from rigsight.simulate import compose, simulate

OMEGA = np.geomspace(1.0, 60.0, 48)
LINEAR = compose(RUNNING_GEAR)


def linear_response(omega: np.ndarray = OMEGA, delay: float = 0.0) -> FrequencyResponse:
    values = 0.81 * np.exp(-1j * omega * delay) / (81.0 - 0.56 * omega**2 + 2j * omega)
    return FrequencyResponse(omega, values, "u", "psi", "rad/A")


def sweep(amplitude: float, duration: float = 30.0) -> Record:
    t = 5e-3 * np.arange(round(duration / 5e-3))
    u = log_sweep(t, amplitude, 0.5, 100.0)
    return Record(f"sweep {amplitude} A", 5e-3, {"u": u}, {"u": "A", "psi": "rad"}, kind="sweep")


def test_peak_and_break_frequency_of_a_pt2() -> None:
    natural = np.sqrt(81.0 / 0.56)
    top = peak(linear_response(np.geomspace(1.0, 60.0, 200)))
    assert top.is_resonance
    assert top.omega == pytest.approx(np.sqrt(81.0 / 0.56 - 2.0 * (1.0 / 0.56) ** 2), rel=2e-3)
    assert top.magnitude == pytest.approx(np.abs(linear_response(np.array([top.omega])).values[0]), rel=5e-3)
    assert break_frequency(linear_response()) == pytest.approx(natural, rel=1e-3)
    # A delay turns the phase and leaves the magnitude.
    late = linear_response(delay=0.02)
    assert break_frequency(late) < 0.98 * natural
    assert fitted_break_frequency(late) == pytest.approx(natural, rel=1e-6)


def test_a_band_that_does_not_show_a_feature_says_so() -> None:
    below = linear_response(np.geomspace(1.0, 5.0, 20))
    assert not peak(below).is_resonance
    with pytest.raises(InputError, match="does not pass -90 degrees"):
        break_frequency(below)


def test_a_slow_sweep_of_a_linear_rig_gives_its_transfer_function() -> None:
    values = {**published_sets()["identified"].values()}
    record = sweep(1.0, duration=240.0)
    found = SpectralRatio("u", "psi", OMEGA, width=0.02)(simulate(LINEAR, values, record))
    error = found.values / linear_response().values - 1.0
    assert np.sqrt(np.mean(np.abs(error) ** 2)) < 0.02


def test_a_ratio_divides_by_the_whole_unit_of_its_source() -> None:
    driven = replace(sweep(1.0).with_signals(psi=np.zeros(6000)), units={"u": "N m", "psi": "rad"})
    assert SpectralRatio("u", "psi", OMEGA)(driven).unit == "rad/(N m)"


def test_a_frequency_beyond_the_nyquist_frequency_is_refused() -> None:
    beyond = np.geomspace(1.0, 900.0, 30)
    with pytest.raises(InputError, match="Nyquist"):
        SpectralRatio("u", "psi", beyond)(sweep(1.0).with_signals(psi=np.zeros(6000)))
