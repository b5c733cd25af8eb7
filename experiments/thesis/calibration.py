"""Models fitted to the virtual rig: one linear set, one Bouc-Wen set for a sweep, one hysteretic set for all."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from operator import attrgetter

import numpy as np
from fit_tables import BAND
from measuring import OURS
from swept_response import SweptResponse
from to_responses import calibrate_to_responses
from virtual_rig import (
    AMPLITUDES,
    CONSTANTS,
    DRIVE,
    GROWTH,
    STRUCTURE,
    excitation,
    measured,
    published_model,
    simulated,
    slow_sweep,
    thesis_sweep,
    times,
)

from rigsight.effects import effect_named
from rigsight.excitation import step
from rigsight.frequency import FrequencyResponse
from rigsight.identify import JointFit, characteristic_scales
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.hysteresis import (
    SpectralRatio,
    break_frequency,
    fitted_break_frequency,
    peak,
)
from rigsight.identify.joint import fit_jointly
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import Structure, compose

Model = tuple[Structure, dict[str, float]]

OMEGA = np.sort(np.concatenate([np.geomspace(1.0, 70.0, 48), np.geomspace(8.1, 16.0, 24)]))
"""Frequencies of the calibration to a sweep [rad/s]; close about the resonance at 1 A."""
NEAR_PEAK = (8.0, 16.0)
ERRORS = (0.02, 0.05)
"""Relative error granted to a line near the peak, and elsewhere: the height of the peak is what sets R, B and P fail at."""
NOISE = {"psi": 1e-4, "y": 1e-4}
"""Residuals granted in fits over time [rad], [m]: what the disturbance makes, not the sensors alone."""
ESTIMATION = (0.25, 0.5, 1.0)
"""Amplitudes of the sweeps that are fitted [A], beside a step of 0.6 A."""
VALIDATION = (0.75,)
STEP_AT = 10.0
ORDINARY = {"a": 0.1, "x_s": 5e-3, "q": 0.0, "k_3": 1e3}
"""Where the hysteretic fit starts: effects as an engineer would guess them; the rig's values are those of the 0.25 A sweep."""


def short_sweep(amplitude: float) -> Record:
    """Return the current of the part of the thesis's sweep that excites the yaw motion, at the same rate."""
    return slow_sweep(amplitude, *BAND, GROWTH)


def short_step(amplitude: float) -> Record:
    return excitation(f"step {amplitude:.2f} A", step(times(20.0), amplitude, STEP_AT), "step", amplitude)


def estimation_records() -> list[Record]:
    return [*(measured(short_sweep(a)) for a in ESTIMATION), measured(short_step(0.6))]


def validation_records() -> list[Record]:
    return [*(measured(short_sweep(a)) for a in VALIDATION), measured(short_step(0.9))]


def band_response(model: Model | None, amplitude: float) -> FrequencyResponse:
    """Return the response of a model, or of the virtual rig itself (None), to the sweep over the band at an amplitude."""
    commanded = short_sweep(amplitude)
    record = measured(commanded) if model is None else simulated(*model, commanded)
    return SpectralRatio("u", "psi", OMEGA)(record)


def features(response: FrequencyResponse) -> dict[str, float]:
    """Return what chapter 6 compares sets by. It does not say how a break frequency is read: both ways are shown."""
    top = peak(response)
    return {
        "static gain": float(response.magnitude[0]),
        "peak height": top.magnitude,
        "resonance": top.omega,
        "break frequency (magnitude)": fitted_break_frequency(response),
        "break frequency (phase)": break_frequency(response),
    }


def with_errors(response: FrequencyResponse) -> FrequencyResponse:
    """Return a response with the errors granted as its variance (real and imaginary part have half of it each)."""
    near = (response.omega > NEAR_PEAK[0]) & (response.omega < NEAR_PEAK[1])
    return replace(response, variance=2.0 * (np.where(near, *ERRORS) * response.magnitude) ** 2)


@cache
def lateral_values() -> dict[str, float]:
    """Return what the response psi to y and the means of the 1 A sweep show; the yaw motion does not depend on it."""
    values = OURS.sweep(measured(thesis_sweep(1.0)))
    return {name: values[name][0] for name in ("l_0", "c_y", "psi_off", "y_off")}


def table_4_1_response() -> FrequencyResponse:
    """Return the PT2 of Table 4.1: what the thesis made of its own 1 A sweep, lags taken out of the phase."""
    _, values = published_model("identified")
    answer = DRIVE / (values["k_c"] - values["J_z"] * OMEGA**2 + 1j * values["k_d"] * OMEGA)
    return FrequencyResponse(OMEGA, answer, "u", "psi", "rad/A", method="Table 4.1")


def bouc_wen_of(target: FrequencyResponse, *, with_lag: bool) -> Model:
    """Return a Bouc-Wen set (A = n = 1) calibrated to a response at 1 A; J_z, k_c and k_d are free too.

    Phases are read only with a lag in the model: the actuator lag of the virtual rig turns them, and Bouc-Wen alone has none.
    """
    effects = ("bouc_wen_hysteresis", *(("actuator_lag",) if with_lag else ()))
    structure = compose(RUNNING_GEAR, [effect_named(name) for name in effects], {"n": 1.0, "A": 1.0})
    lateral = lateral_values()
    found = calibrate_to_responses(
        structure,
        [SweptResponse(with_errors(target), short_sweep(1.0))],
        CONSTANTS,
        np.random.default_rng(1),
        start=lateral,
        free=("J_z", "k_c", "k_d", "a", "beta", "gamma", *(("T_a",) if with_lag else ())),
        with_phase=with_lag,
    )
    return structure, {**found.values, **lateral}


@cache
def bouc_wen_of_peak_and_break() -> Model:
    """Return the Bouc-Wen set with peak and break frequency of the virtual rig's 1 A sweep."""
    return bouc_wen_of(band_response(None, 1.0), with_lag=False)


@cache
def bouc_wen_with_lag() -> Model:
    """Return the same with an actuator lag beside the hysteresis, fitted to magnitudes and phases."""
    return bouc_wen_of(band_response(None, 1.0), with_lag=True)


@cache
def joint_fit() -> JointFit:
    """Return the best single linear set for sweeps and a step, and what each kind alone gives."""
    # In free run, y inherits the error of psi: fitted to y as well, c_y would make up for what the yaw equation lacks.
    records = [replace(r, signals={name: r[name] for name in ("u", "psi")}) for r in estimation_records()]
    lateral = {name: value for name, value in lateral_values().items() if name != "psi_off"}
    return fit_jointly(compose(RUNNING_GEAR), records, CONSTANTS, lateral, {}, group_of=attrgetter("kind"))


def joint_linear() -> Model:
    return compose(RUNNING_GEAR), joint_fit().fit.values


@cache
def fitted_to_both() -> Model:
    """Return the set of the virtual rig's own equations, fitted to sweeps and a step from ordinary start values."""
    records = estimation_records()
    linear = OURS.sweep(measured(thesis_sweep(AMPLITUDES[0])))
    start = {name: value for name, (value, _) in linear.items() if name != "dead_time"}
    # A lag and a dead time of the same length turn the phase alike at low frequencies.
    start |= {**CONSTANTS, **ORDINARY, "T_a": linear["dead_time"][0]}
    free = [p.name for p in STRUCTURE.parameters if p.fitted and p.name not in CONSTANTS]
    scales = characteristic_scales(RUNNING_GEAR, records, start)
    fit = GreyBoxFit(STRUCTURE, records, scales, NOISE, accuracy=1e-3).fit(start, free, finish=False)
    return STRUCTURE, fit.values
