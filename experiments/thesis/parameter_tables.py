"""Parameters of the virtual rig by the method of the thesis and by ours: Tables 3.1, 4.1 and 5.2."""

from __future__ import annotations

from functools import cache

import numpy as np
from measuring import OURS, THESIS, Method, Values, conicity
from rich.table import Table
from virtual_rig import (
    AMPLITUDES,
    VIRTUAL_RIG,
    measured,
    published_model,
    simulated,
    thesis_step,
    thesis_sweep,
)

from rigsight.frequency import FrequencyResponse
from rigsight.identify.hysteresis import peak
from rigsight.rigs.published import PublishedSet, published_sets

ROWS = {
    "l_0": "m",
    "delta_0": "rad",
    "y_off": "m",
    "J_z": "kg m2",
    "k_c": "N m/rad",
    "k_d": "N m s/rad",
    "psi_off": "rad",
}
RESONANCES = {0.25: 42.0, 0.5: 26.0, 0.75: 19.0, 1.0: 12.0, 1.25: 12.0, 1.5: 14.0}
"""Amplitude [A] -> resonance read off Figure 5.6 [rad/s]."""
IDENTIFIED_DELTA_0 = -0.15
"""Table 4.1; the published sets hold the nominal value, which the thesis goes on with."""
_LINES = 15
"""Lines over which a thesis response is averaged before its peak is read, as an eye does."""


def text(value: float, error: float = float("nan")) -> str:
    """Write a value with the half-width of its 95 % interval, if it has one."""
    if np.isnan(value):
        return "none"
    return f"{value:.3g}" if np.isnan(error) else f"{value:.3g} +- {1.96 * error:.1g}"


def printed(published: PublishedSet, name: str) -> str:
    return f"{published.given.get(name, published.parameters.get(name, float('nan'))):.3g}"


def found(values: Values, name: str) -> str:
    return text(*(conicity(values) if name == "delta_0" else values[name]))


def resonance(response: FrequencyResponse) -> float:
    """Return where the magnitude is largest [rad/s]; one without variances is smoothed first."""
    if response.variance is not None:
        sure = np.sqrt(response.variance) < 0.1 * response.magnitude
        response = response.at(sure)
        return peak(response).omega
    smooth = np.convolve(response.magnitude, np.full(_LINES, 1.0 / _LINES), mode="valid")
    return float(response.omega[_LINES // 2 + int(np.argmax(smooth))])


def table_3_1() -> Table:
    """Chapter 3: the simulation with nominal parameters shows the parameters that it was given."""
    structure, values = published_model("nominal")
    record = simulated(structure, values, thesis_sweep(1.0))
    nominal = published_sets()["nominal"]
    table = Table("", "published", *(f"back from a simulated sweep, {m.title}" for m in (THESIS, OURS)))
    table.title = "Table 3.1: nominal parameters"
    back = [method.sweep(record) for method in (THESIS, OURS)]
    for name, unit in ROWS.items():
        table.add_row(f"{name} in {unit}", printed(nominal, name), *(found(values, name) for values in back))
    return table


def table_4_1() -> Table:
    """Reference from steps and identified from sweeps; the nominal column is Table 3.1's."""
    sets = published_sets()
    of_step = [method.step(measured(thesis_step())) for method in (THESIS, OURS)]
    of_sweep = [method.sweep(measured(thesis_sweep(1.0))) for method in (THESIS, OURS)]
    table = Table(
        "",
        "nominal",
        "reference, published",
        "step, method of the thesis",
        "step, ours",
        "identified, published",
        "sweep, method of the thesis",
        "sweep, ours",
    )
    table.title = "Table 4.1: parameters from a step (0.6 A) and from a sweep (1 A)"
    for name, unit in ROWS.items():
        identified = f"{IDENTIFIED_DELTA_0:.3g}" if name == "delta_0" else printed(sets["identified"], name)
        table.add_row(
            f"{name} in {unit}",
            printed(sets["nominal"], name),
            printed(sets["reference"], name),
            *(found(values, name) for values in of_step),
            identified,
            *(found(values, name) for values in of_sweep),
        )
    table.add_row(
        "dead time in s",
        "-",
        "-",
        "-",
        text(*of_step[1]["dead_time"]),
        "-",
        "-",
        text(*of_sweep[1]["dead_time"]),
    )
    table.caption = f"The virtual rig: l_0 {VIRTUAL_RIG.parameters['l_0']:g} m, delta_0 {VIRTUAL_RIG.given['delta_0']:g} rad"
    return table


@cache
def values_by_amplitude(method: Method) -> dict[float, Values]:
    """Return what each sweep of Table 5.2 shows."""
    return {amplitude: method.sweep(measured(thesis_sweep(amplitude))) for amplitude in AMPLITUDES[:4]}


def table_5_2() -> Table:
    """Parameters and resonance per amplitude."""
    published = {s.amplitude: s for s in published_sets().values() if s.amplitude is not None}
    methods = {method.title: values_by_amplitude(method) for method in (THESIS, OURS)}
    table = Table("", "", *(f"{amplitude:.2f} A" for amplitude in AMPLITUDES))
    table.title = "Table 5.2 and the resonances of Figure 5.6: parameters per amplitude of the sweep"
    for name, unit in ROWS.items():
        cells = [
            f"{IDENTIFIED_DELTA_0:.3g}" if name == "delta_0" else printed(published[amplitude], name)
            for amplitude in AMPLITUDES[:4]
        ]
        table.add_row(f"{name} in {unit}", "published", *cells)
        for title, values in methods.items():
            table.add_row("", title, *(found(values[amplitude], name) for amplitude in AMPLITUDES[:4]))
    table.add_row("dead time in s", "ours", *(text(*methods["ours"][a]["dead_time"]) for a in AMPLITUDES[:4]))
    table.add_row("resonance in rad/s", "published", *(f"{RESONANCES[a]:g}" for a in AMPLITUDES))
    for method in (THESIS, OURS):
        tops = [resonance(magnitudes(method, amplitude)) for amplitude in AMPLITUDES]
        table.add_row("", method.title, *(f"{top:.1f}" for top in tops))
    return table


@cache
def magnitudes(method: Method, amplitude: float) -> FrequencyResponse:
    """Return the response of the yaw angle at an amplitude, with all amplitudes cut alike."""
    return method.response(measured(thesis_sweep(amplitude)), "u", "psi")
