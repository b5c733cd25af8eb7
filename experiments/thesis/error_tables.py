"""Errors of the parameter sets against the virtual rig: Tables 5.1, 6.1, 6.2 and the step comparison."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from calibration import (
    band_response,
    bouc_wen_of_peak_and_break,
    bouc_wen_with_lag,
    features,
    fitted_to_both,
    joint_linear,
)
from measuring import CUTS, OURS, PAIRS, THESIS, response_errors, simulated_pair
from rich.table import Table
from virtual_rig import STEP_START, measured, published_model, simulated, thesis_step, thesis_sweep

from rigsight.metrics import rms
from rigsight.simulate import Structure

Model = tuple[Structure, dict[str, float]]

_SETS = ("nominal", "reference", "identified", "hysteresis_r", "hysteresis_p", "hysteresis_b")
PUBLISHED = {
    "u -> psi magnitude in rad/A": dict(
        zip(_SETS, (1.4e-2, 7.0e-3, 1.9e-3, 6.1e-3, 3.3e-3, 3.6e-3), strict=True)
    ),
    "u -> psi phase in rad": dict(zip(_SETS, (0.67, 0.98, 0.49, 0.55, 0.50, 0.47), strict=True)),
    "psi -> y magnitude in m/rad": dict(
        zip(_SETS, (3.2e-2, 3.3e-2, 3.3e-2, 3.4e-2, 3.3e-2, 3.4e-2), strict=True)
    ),
    "psi -> y phase in rad": dict(zip(_SETS, (0.53, 0.62, 0.53, 0.55, 0.54, 0.54), strict=True)),
    "u -> y magnitude in m/A": {"identified": 4.29e-4},
    "u -> y phase in rad": {"identified": 0.56},
}
"""Tables 5.1 and 6.2, and section 5.1.2."""
PUBLISHED_STEP = {"reference": 1.6e-3, "identified": 3.0e-3}
STEP_WINDOW = (STEP_START, STEP_START + 4.0)
_BEFORE = 5.0
"""Seconds before the step whose mean is the offset that is removed."""


def models_5_1() -> dict[str, Model]:
    return {
        **{name: published_model(name) for name in ("nominal", "reference", "identified")},
        "ours, one linear set": joint_linear(),
    }


def models_6_2() -> dict[str, Model]:
    return {
        **{
            name: published_model(name)
            for name in ("identified", "hysteresis_r", "hysteresis_p", "hysteresis_b")
        },
        "ours, Bouc-Wen": bouc_wen_of_peak_and_break(),
        "ours, Bouc-Wen and lag": bouc_wen_with_lag(),
        "ours, for sweeps and steps": fitted_to_both(),
    }


def errors(models: Mapping[str, Model], title: str) -> Table:
    """Return the RMSE (5.1) of responses against the measured 1 A sweep: published, by the thesis's method, by ours."""
    measured_sweep = measured(thesis_sweep(1.0))
    table = Table("", "", *models)
    table.title = title
    for source, response in (*PAIRS, ("u", "y")):
        computed = {method.title: [] for method in (THESIS, OURS)}
        for method in (THESIS, OURS):
            seen = method.response(measured_sweep, source, response).band(0.0, CUTS[response])
            for structure, values in models.values():
                record = simulated(structure, values, thesis_sweep(1.0))
                computed[method.title].append(
                    response_errors(seen, simulated_pair(method, record, source, response))
                )
        for i, kind in enumerate(("magnitude", "phase")):
            row = next(row for row in PUBLISHED if row.startswith(f"{source} -> {response} {kind}"))
            table.add_row(row, "published", *(_error(PUBLISHED[row].get(name)) for name in models))
            for method_title, pairs in computed.items():
                table.add_row("", method_title, *(_error(pair[i]) for pair in pairs))
    return table


def _error(value: float | None) -> str:
    return "-" if value is None else f"{value:.2g}"


def table_5_1() -> Table:
    """Errors of the linear sets, and section 5.1.2 (u to y)."""
    return errors(models_5_1(), "Table 5.1 and section 5.1.2: RMSE against the 1 A sweep, linear sets")


def table_6_2() -> Table:
    """Errors of the sets with hysteresis."""
    return errors(models_6_2(), "Table 6.2: RMSE against the 1 A sweep, sets with hysteresis")


def table_6_1() -> Table:
    """The Bouc-Wen sets, and which of peak height and break frequency each of them meets."""
    names = ("A", "a", "beta", "gamma", "n", "J_z", "k_c", "k_d")
    rows = (
        "static gain",
        "peak height",
        "resonance",
        "break frequency (magnitude)",
        "break frequency (phase)",
    )
    models = {
        **{f"set {key}": published_model(f"hysteresis_{key.lower()}") for key in "RBP"},
        "ours": bouc_wen_of_peak_and_break(),
        "ours, with an actuator lag": bouc_wen_with_lag(),
    }
    table = Table("", *models)
    table.title = "Table 6.1: Bouc-Wen sets, and their deviations from the 1 A sweep of the virtual rig"
    for name in names:
        cells = [{**dict(structure.fixed), **values}[name] for structure, values in models.values()]
        table.add_row(name, *(f"{value:.4g}" for value in cells))
    aim = features(band_response(None, 1.0))
    of_models = [features(band_response(model, 1.0)) for model in models.values()]
    for row in rows:
        table.add_row(f"{row}, {aim[row]:.4g}", *(f"{f[row] / aim[row] - 1.0:+.1%}" for f in of_models))
    return table


@cache
def step_errors() -> dict[str, float]:
    """Return the RMSE of the yaw angle [rad] from 180 to 184 s, offsets before the step removed, by model."""
    record = measured(thesis_step())
    models = {name: published_model(name) for name in _SETS}
    models |= {"ours, one linear set": joint_linear(), "ours, Bouc-Wen": bouc_wen_of_peak_and_break()}
    models |= {"ours, Bouc-Wen and lag": bouc_wen_with_lag()}
    models |= {"ours, for sweeps and steps": fitted_to_both()}
    before = (record.t >= STEP_START - _BEFORE) & (record.t < STEP_START)
    inside = (record.t >= STEP_WINDOW[0]) & (record.t <= STEP_WINDOW[1])
    found = {}
    for name, (structure, values) in models.items():
        own = simulated(structure, values, thesis_step())["psi"]
        moved, aim = (psi[inside] - np.mean(psi[before]) for psi in (own, record["psi"]))
        found[name] = rms(moved - aim)
    return found


def step_comparison() -> Table:
    """Section 5.2.2."""
    table = Table("set", "published", "on the virtual rig")
    table.title = "Step of 0.6 A, 180 to 184 s: RMSE of psi in rad"
    for name, error in step_errors().items():
        table.add_row(name, _error(PUBLISHED_STEP.get(name)), _error(error))
    return table
