"""Results for the open questions of the thesis; docs/thesis.md draws the conclusions."""

from __future__ import annotations

import numpy as np
from calibration import (
    Model,
    band_response,
    bouc_wen_of_peak_and_break,
    bouc_wen_with_lag,
    estimation_records,
    features,
    fitted_to_both,
    joint_fit,
    joint_linear,
    table_4_1_response,
    validation_records,
)
from fit_tables import FIGURE_5_6, Sweeps, structure_with, target_peak, vectors
from measuring import our_pair
from parameter_tables import text
from rich.console import Group
from rich.table import Table
from thesis_formulas import creep_error_of_sine, lateral_parameters
from virtual_rig import (
    AMPLITUDES,
    CONSTANTS,
    DT,
    GROWTH,
    NOISE,
    STRUCTURE,
    VIRTUAL_RIG,
    measured,
    published_model,
    simulated,
    slow_sweep,
    thesis_sweep,
)

from rigsight.identify import estimate_conicity, fit_frequency_response
from rigsight.identify.hysteresis import SpectralRatio, peak
from rigsight.identify.transfer.conicity import conicity_slope
from rigsight.metrics import nrmse
from rigsight.records import Record

BOUC_WEN_ALONE = {
    "J_z": 0.44046, "k_c": 632.05, "k_d": 0.29559, "A": 1.0, "a": 0.098914, "beta": 7231.7, "gamma": -6107.1, "n": 1.0,
}  # fmt: skip
"""What ``fit_tables.py search 40 1 bouc_wen_hysteresis`` gave."""
_SHOWN = ("J_z", "k_c", "k_d", "a", "beta", "gamma", "T_a")
RULER = 5e-4
"""Standard error of a length taken with a ruler [m]."""
SCALE_ERROR = 1.02
"""An error of the scale of y that nobody noticed."""


def one_model_for_all_amplitudes() -> Table:
    """Question 1: errors [dB rms] against the fits of Table 5.2, and peaks, of models with constant parameters."""
    iwan = structure_with(tuple(VIRTUAL_RIG.effects))
    values = VIRTUAL_RIG.values()
    bouc_wen = structure_with(("bouc_wen_hysteresis",))
    cases = {
        "iwan_tables": (iwan, values),
        "without the lag (1 ms)": (iwan, {**values, "T_a": 1e-3}),
        "without the cubic stiffness": (iwan, {**values, "k_3": 0.0}),
        "without hysteresis (soft spring only)": (
            iwan,
            {**values, "k_c": values["a"] * values["k_c"], "a": 1.0},
        ),
        "Bouc-Wen alone": (bouc_wen, {**values, **BOUC_WEN_ALONE}),
    }
    table = Table(
        "one model, constant parameters", "all", *(f"{amplitude:.2f} A" for amplitude in AMPLITUDES)
    )
    table.title = "Question 1: dB rms against Table 5.2, 1 to 70 rad/s / resonance in rad/s"
    table.add_row("published resonance", "", *(f"{target_peak(a):.1f}" for a in AMPLITUDES))
    for title, (structure, own) in cases.items():
        found = Sweeps(structure).evaluate(vectors(structure, own))
        cells = [
            (f"{found.errors[a][0]:.2f} / " if a in found.errors else "") + f"{found.peaks[a][0]:.1f}"
            for a in AMPLITUDES
        ]
        table.add_row(title, f"{found.total[0]:.2f}", *cells)
    return table


def peak_and_break() -> Group:
    """Question 2: which set meets peak height and break frequency at 1 A, and what becomes of ours at other amplitudes."""
    ours = {
        "ours": bouc_wen_of_peak_and_break(),
        "ours, with an actuator lag": bouc_wen_with_lag(),
    }
    models = {**{f"set {key}": published_model(f"hysteresis_{key.lower()}") for key in "RBP"}, **ours}
    names = ("peak height", "break frequency (magnitude)", "break frequency (phase)")
    at_one = Table("", *(f"{name}, {of}" for of in ("virtual rig", "Table 4.1") for name in names))
    at_one.title = "Question 2: deviations at 1 A from the virtual rig and from the PT2 of Table 4.1"
    aims = [features(band_response(None, 1.0)), features(table_4_1_response())]
    for title, model in models.items():
        own = features(band_response(model, 1.0))
        at_one.add_row(title, *(f"{own[name] / aim[name] - 1.0:+.1%}" for aim in aims for name in names))
    at_one.caption = "\n".join(
        f"{title}: " + ", ".join(f"{n} {v:.4g}" for n, v in values.items() if n in _SHOWN)
        for title, (_, values) in ours.items()
    )
    return Group(
        at_one,
        "",
        _at_other_amplitudes("ours", ours["ours"]),
        "",
        _at_other_amplitudes(*list(ours.items())[1]),
    )


def _at_other_amplitudes(title: str, model: Model) -> Table:
    names = ("peak height", "resonance", "break frequency (magnitude)", "break frequency (phase)")
    table = Table("", *(f"{amplitude:.2f} A" for amplitude in AMPLITUDES))
    table.title = f"Question 2: the Bouc-Wen set '{title}', calibrated at 1 A, against the virtual rig"
    pairs = [(band_response(model, a), band_response(None, a)) for a in AMPLITUDES]
    ratios = [20.0 * np.log10(own.magnitude / rig.magnitude) for own, rig in pairs]
    table.add_row("magnitude, dB rms", *(f"{np.sqrt(np.mean(ratio**2)):.2f}" for ratio in ratios))
    read = [(features(own), features(rig)) for own, rig in pairs]
    for name in names:
        table.add_row(name, *(f"{own[name] / rig[name] - 1.0:+.1%}" for own, rig in read))
    return table


def sweeps_and_steps() -> Table:
    """Question 3: free-run NRMSE of psi and y on sweeps and steps, fitted and not."""
    models = {
        "reference (published)": published_model("reference"),
        "identified (published)": published_model("identified"),
        "best linear set": joint_linear(),
        "Iwan, cubic, lag: fitted": fitted_to_both(),
        "the virtual rig itself": (STRUCTURE, VIRTUAL_RIG.values()),
    }
    table = Table("record", *models)
    table.title = "Question 3: NRMSE in free run, psi / y"
    fitted, held_out = estimation_records(), validation_records()
    for record in (*fitted, *held_out):
        cells = []
        for model in models.values():
            own = simulated(*model, record)
            cells.append(" / ".join(f"{nrmse(record[n] - own[n], record[n]):.3f}" for n in ("psi", "y")))
        table.add_row(record.name + (", not fitted" if record in held_out else ""), *cells)
    joint = joint_fit()
    alone = "; ".join(
        f"{kind.kind} alone: " + ", ".join(f"{n} {kind.fit.values[n]:.3g}" for n in ("J_z", "k_c", "k_d"))
        for kind in joint.kinds
    )
    both = ", ".join(f"{n} {joint.fit.values[n]:.3g}" for n in ("J_z", "k_c", "k_d"))
    hysteretic = ", ".join(
        f"{name} {value:.4g}" for name, value in fitted_to_both()[1].items() if name not in CONSTANTS
    )
    table.caption = (
        f"Linear. Together: {both}; {alone} (by chance with probability {joint.probability:.1g}).\n"
        f"Fitted hysteretic set: {hysteretic}"
    )
    return table


def conicity_table() -> Table:
    """Question 4: delta_0 with its interval, from gain and break frequency, and with l_0 from a ruler."""
    table = Table(
        "record",
        "c_y",
        "delta_0 in rad",
        "95 % interval in rad",
        "c_y, ruler",
        "delta_0 in rad, ruler",
        "95 % interval",
    )
    table.title = "Question 4: delta_0 from the psi -> y response"
    records = {f"sweep {a:.2f} A": measured(thesis_sweep(a)) for a in AMPLITUDES[:4]}
    one = records["sweep 1.00 A"]
    records["sweep 1.00 A, y 2 % too large"] = one.with_signals(y=SCALE_ERROR * one["y"])
    for name, record in records.items():
        table.add_row(name, *_conicity_cells(record))
    thesis = estimate_conicity(1.1 * VIRTUAL_RIG.parameters["c_y"], 0.0, CONSTANTS["r_0"], CONSTANTS["b"])
    l_0, c_y = VIRTUAL_RIG.parameters["l_0"], VIRTUAL_RIG.parameters["c_y"]
    omega_b = c_y * CONSTANTS["v"] / (2.0 * l_0)
    psi = 0.5 * float(np.ptp(one["psi"][one.t < 90.0]))
    _, error = creep_error_of_sine(omega_b, psi, NOISE["y"], round(60.0 / DT), l_0, omega_b)
    slope = abs(conicity_slope(VIRTUAL_RIG.given["delta_0"], CONSTANTS["r_0"], CONSTANTS["b"]))
    best = 1.96 * error * c_y / slope
    table.caption = (
        f"A break frequency 10 % too high gives delta_0 = {thesis.unbounded:.2f} rad. Best possible from 60 s "
        f"of a sine at {omega_b:.2f} rad/s with psi of {psi:.2g} rad: delta_0 to {best:.1e} rad (95 %), as long as speed and "
        f"scales are exact; 1 % of the speed is {0.01 * c_y / slope:.2g} rad."
    )
    return table


def _conicity_cells(record: Record) -> list[str]:
    fit = fit_frequency_response(our_pair(record, "psi", "y"), "pt1")
    cells = []
    for ruler in (None, (VIRTUAL_RIG.parameters["l_0"], RULER)):
        found = lateral_parameters(fit, CONSTANTS, known_l_0=ruler)
        c_y, error = found.values["c_y"], found.standard_errors["c_y"]
        own = estimate_conicity(c_y, error, CONSTANTS["r_0"], CONSTANTS["b"])
        interval = "none" if own.interval is None else f"{own.interval[0]:.3g} to {own.interval[1]:.3g}"
        cells += [text(c_y, error), text(float("nan") if own.unbounded is None else own.unbounded), interval]
    return cells


def upward_turn() -> Table:
    """Question 5: resonance [rad/s] over amplitude, by rate and direction of the sweep, and without cubic stiffness."""
    table = Table("sweep", *(f"{amplitude:.2f} A" for amplitude in AMPLITUDES))
    table.title = "Question 5: resonance of the virtual rig in rad/s, without noise"
    table.add_row(
        "Figure 5.6 (read off)", "42", "26", "19", "12", *(f"{FIGURE_5_6[a]:g}" for a in AMPLITUDES[4:])
    )
    values = VIRTUAL_RIG.values()
    soft = {**values, "k_3": 0.0}
    cases = {
        "rate of the thesis, upward": (values, 1.0, False),
        "the same, downward": (values, 1.0, True),
        "4 times slower, upward": (values, 0.25, False),
        "4 times slower, downward": (values, 0.25, True),
        "16 times slower, upward": (values, 1.0 / 16.0, False),
        "rate of the thesis, no cubic stiffness": (soft, 1.0, False),
        "16 times slower, no cubic stiffness": (soft, 1.0 / 16.0, False),
    }
    for title, (own, rate, downward) in cases.items():
        tops = [_resonance(own, amplitude, rate, downward) for amplitude in AMPLITUDES]
        table.add_row(title, *(f"{top:.1f}" for top in tops))
    return table


def _resonance(values: dict[str, float], amplitude: float, rate: float, downward: bool) -> float:
    commanded = slow_sweep(amplitude, 3.0, 80.0, rate * GROWTH)
    if downward:
        # A sweep backward in time is one from high to low frequencies.
        commanded = commanded.with_signals(u=commanded["u"][::-1])
    record = simulated(STRUCTURE, values, commanded)
    omega = np.geomspace(5.0, 60.0, 90)
    return peak(SpectralRatio("u", "psi", omega)(record)).omega
