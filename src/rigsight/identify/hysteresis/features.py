"""Peak and break frequency of a frequency response."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse
from rigsight.identify.transfer.transfer_function import fit_frequency_response


@dataclass(frozen=True)
class Peak:
    """The highest point of a magnitude."""

    omega: float  # angular frequency [rad/s]
    magnitude: float  # in the unit of the response
    is_resonance: bool  # False at the first or last line of the band: the response has no peak in it


def peak(response: FrequencyResponse) -> Peak:
    """Return the highest point, by a parabola through the logarithms of three points if it is inside the band."""
    level = np.log(np.maximum(response.magnitude, 1e-300))
    top = int(np.argmax(level))
    if not 0 < top < level.size - 1:
        return Peak(float(response.omega[top]), float(response.magnitude[top]), is_resonance=False)
    place = np.log(response.omega[top - 1 : top + 2] / response.omega[top])
    curvature, slope, height = np.polyfit(place, level[top - 1 : top + 2], 2)
    shift = float(np.clip(-0.5 * slope / curvature, place[0], place[2])) if curvature < 0.0 else 0.0
    return Peak(
        float(response.omega[top] * np.exp(shift)),
        float(np.exp(height + slope * shift + curvature * shift**2)),
        is_resonance=True,
    )


def break_frequency(response: FrequencyResponse) -> float:
    """Return the break frequency [rad/s], at which the phase first passes -90 degrees; refused if it does not within the band.

    The thesis defines omega_b by the PT2 (2.9), whose phase is "reaching -90 degrees at the break frequency" (section 2.2.2).
    Chapter 6 gives the break frequency of hysteretic simulations without stating how it is determined for a curve that is not a
    PT2. This definition reproduces its statements: compared with the PT2 of Table 4.1 at 1 A, set B has the right break frequency
    (0.4 %) and half the peak, and that of set P is too low (10 %). From the magnitude, that of set B would be 4 % too high.
    For responses whose phase is changed by delays or lags see `fitted_break_frequency`.
    """
    phase = response.phase
    phase = phase - 2.0 * np.pi * np.round(phase[0] / (2.0 * np.pi))
    below = np.flatnonzero(phase <= -0.5 * np.pi)
    if below.size == 0 or below[0] == 0:
        raise InputError(
            f"The phase of {response.source} -> {response.response} does not pass -90 degrees between "
            f"{response.omega[0]:.4g} and {response.omega[-1]:.4g} rad/s: there is no natural frequency to read off."
        )
    after = int(below[0])
    pair = slice(after - 1, after + 1)
    share = (phase[after - 1] + 0.5 * np.pi) / (phase[after - 1] - phase[after])
    low, high = np.log(response.omega[pair])
    return float(np.exp(low + share * (high - low)))


def fitted_break_frequency(response: FrequencyResponse) -> float:
    """Return omega_b [rad/s] of the PT2 that fits the magnitude best, with equal weights in dB, as in a fit by eye.

    This is the manual fit of section 4.4 of the thesis, which does not use the phase; delays and lags do not affect it.
    """
    found = fit_frequency_response(response, "pt2", magnitude_only=True, weighting="relative")
    if not found.success:
        raise InputError(f"The break frequency cannot be read off the magnitude: {found.message}")
    return found.values["omega_b"]
