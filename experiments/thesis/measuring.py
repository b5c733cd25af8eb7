"""Evaluation of a record of the virtual rig with the method of the thesis and with ours.

Method of the thesis: ratio of Fourier transforms, cut at 80 and 30 rad/s, phase rescaled; a PT2 and a PT1 fitted to the
magnitudes alone (its manual grid search); a PT2 fitted to a step; offsets as means. Ours: local rational method with the
variance of every line; maximum likelihood with a dead time where the current drives; offsets without what the current pushes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from driven_offsets import driven_offsets
from thesis_formulas import ROLLING, lateral_parameters, offsets, yaw_parameters
from transfer_step import fit_step
from virtual_rig import CONSTANTS, STEP_START

from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse, local_rational_response, thesis_response
from rigsight.identify import estimate_conicity, fit_frequency_response
from rigsight.identify.transfer.record_response import record_response
from rigsight.metrics import rms
from rigsight.records import Record
from rigsight.rigs import evaluated

PAIRS = (("u", "psi"), ("psi", "y"))
CUTS = {"psi": 80.0, "y": 30.0}
"""Where the thesis cuts the spectra [rad/s], by response."""
LONGEST_DEAD_TIME = 0.1
STEP_WINDOW = (STEP_START - 2.0, STEP_START + 10.0)
_NARROWER = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15)
"""Shares of the cut that are tried, as the thesis does where the unwrapped phase jumps (section 4.3)."""

Values = dict[str, tuple[float, float]]
"""Parameter -> value and standard error; the error is NaN where the method gives none."""


@dataclass(frozen=True)
class Method:
    """One of the two ways to a frequency response and to parameters."""

    title: str
    response: Callable[[Record, str, str], FrequencyResponse]
    sweep: Callable[[Record], Values]
    step: Callable[[Record], Values]


def thesis_pair(record: Record, source: str, response: str) -> FrequencyResponse:
    """Return the response of the thesis; ``u -> y`` loses 270 degrees."""
    drop = {"upsi": np.pi, "psiy": 0.5 * np.pi, "uy": 1.5 * np.pi}[source + response]
    for share in _NARROWER:
        try:
            return thesis_response(record, source, response, drop, share * CUTS[response])
        except InputError:
            if share == _NARROWER[-1]:
                raise
    raise AssertionError


def thesis_sweep_values(record: Record) -> Values:
    yaw = fit_frequency_response(
        thesis_pair(record, "u", "psi"), "pt2", magnitude_only=True, weighting="uniform"
    )
    lateral = fit_frequency_response(
        thesis_pair(record, "psi", "y"), "pt1", magnitude_only=True, weighting="uniform"
    )
    values = {**yaw_parameters(yaw, CONSTANTS).values, **lateral_parameters(lateral, CONSTANTS).values}
    values["psi_off"] = float(np.mean(record["psi"]))
    values["y_off"] = float(np.mean(record["y"])) - evaluated(ROLLING.static_gain, values) * values["psi_off"]
    return without_errors(values)


def thesis_step_values(record: Record) -> Values:
    yaw = fit_step(record, "u", "psi", "pt2", *STEP_WINDOW)
    lateral = fit_step(replace(record, hold="foh"), "psi", "y", "pt1", *STEP_WINDOW)
    values = {**yaw_parameters(yaw, CONSTANTS).values, **lateral_parameters(lateral, CONSTANTS).values}
    before = record.t < STEP_START
    values["psi_off"] = float(np.mean(record["psi"][before]))
    values["y_off"] = (
        float(np.mean(record["y"][before])) - evaluated(ROLLING.static_gain, values) * values["psi_off"]
    )
    return without_errors(values)


def our_pair(record: Record, source: str, response: str) -> FrequencyResponse:
    """Return the local rational response where it stands out of its uncertainty."""
    order = "pt2" if response == "psi" else "pt1"
    hold = record.hold if source == "u" else "band_limited"
    return record_response(
        record, source, response, order, "local_rational", hold=hold, drive="u"
    ).response.band(0.0, 100.0)


def our_sweep_values(record: Record) -> Values:
    yaw = fit_frequency_response(our_pair(record, "u", "psi"), "pt2", LONGEST_DEAD_TIME)
    lateral = fit_frequency_response(our_pair(record, "psi", "y"), "pt1")
    own = lateral_parameters(lateral, CONSTANTS)
    rest = driven_offsets(record, yaw, lateral)
    found = [yaw_parameters(yaw, CONSTANTS), own, rest]
    values = {name: (part.values[name], part.standard_errors[name]) for part in found for name in part.names}
    return {**values, "dead_time": (yaw.values["dead_time"], yaw.standard_errors["dead_time"])}


def our_step_values(record: Record) -> Values:
    yaw = fit_step(record, "u", "psi", "pt2", *STEP_WINDOW, LONGEST_DEAD_TIME)
    lateral = fit_step(replace(record, hold="foh"), "psi", "y", "pt1", *STEP_WINDOW)
    own = lateral_parameters(lateral, CONSTANTS)
    rest = offsets(record, own.values["l_0"], own.standard_errors["l_0"], stop=STEP_START - record.dt)
    found = [yaw_parameters(yaw, CONSTANTS), own, rest]
    values = {name: (part.values[name], part.standard_errors[name]) for part in found for name in part.names}
    return {**values, "dead_time": (yaw.values["dead_time"], yaw.standard_errors["dead_time"])}


def without_errors(values: Mapping[str, float]) -> Values:
    return {name: (value, float("nan")) for name, value in values.items()}


THESIS = Method("method of the thesis", thesis_pair, thesis_sweep_values, thesis_step_values)
OURS = Method("ours", our_pair, our_sweep_values, our_step_values)


def conicity(values: Values) -> tuple[float, float]:
    """Return delta_0 and its standard error [rad]: the root of (2.12), negative ones too, as the thesis takes it."""
    error = 0.0 if np.isnan(values["c_y"][1]) else values["c_y"][1]
    found = estimate_conicity(values["c_y"][0], error, CONSTANTS["r_0"], CONSTANTS["b"])
    return (float("nan") if found.unbounded is None else found.unbounded), (
        found.standard_error if error else float("nan")
    )


def response_errors(measured: FrequencyResponse, simulated: FrequencyResponse) -> tuple[float, float]:
    """Return RMSE (5.1) of magnitude, in the unit of the response, and of phase [rad] over the lines of both.

    Phases are compared as they are: unwrapped and rescaled for the method of the thesis; next to each other for ours.
    """
    _, of_measured, of_simulated = np.intersect1d(
        np.round(measured.omega, 9), np.round(simulated.omega, 9), return_indices=True
    )
    one, other = measured.values[of_measured], simulated.values[of_simulated]
    magnitude = rms(np.abs(one) - np.abs(other))
    if measured.method.startswith("thesis"):
        return magnitude, rms(measured.phase[of_measured] - simulated.phase[of_simulated])
    return magnitude, rms(np.angle(one / other))


def simulated_pair(method: Method, simulated: Record, source: str, response: str) -> FrequencyResponse:
    """Return the response of a simulated sweep by the same method; it has no noise, so no line of it is doubtful."""
    if method is THESIS:
        return thesis_pair(simulated, source, response)
    hold = simulated.hold if source == "u" else "band_limited"
    return local_rational_response(simulated, source, response, hold=hold)
