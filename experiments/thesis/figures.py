"""Figures of the thesis on the virtual rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from calibration import (
    band_response,
    bouc_wen_of_peak_and_break,
    bouc_wen_with_lag,
    fitted_to_both,
    joint_linear,
)
from matplotlib.figure import Figure
from measuring import CUTS, OURS, PAIRS, THESIS, simulated_pair
from parameter_tables import values_by_amplitude
from rich.table import Table
from virtual_rig import (
    AMPLITUDES,
    CONSTANTS,
    STEP_START,
    VIRTUAL_RIG,
    measured,
    other_sweep,
    published_model,
    simulated,
    thesis_step,
    thesis_sweep,
)

from rigsight.frequency import FrequencyResponse
from rigsight.plot import Panel, overlaid_responses, style
from rigsight.plot.drawing import plain_log_ticks
from rigsight.records import Record
from rigsight.rigs.published import published_sets
from rigsight.workflow.vary import run_vary

COLORS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00")
PARAMETERS = {"k_d": "N m s/rad", "k_c": "N m/rad", "J_z": "kg m2", "psi_off": "rad", "y_off": "m"}


def draw_all(out: Path) -> Table:
    """Draw all figures into a folder and list them."""
    out.mkdir(parents=True, exist_ok=True)
    linear, hysteretic = ("nominal", "reference", "identified"), ("identified", "hysteresis_r")
    fitted = ("hysteresis_r", "hysteresis_p", "hysteresis_b")
    drawn = {
        "figure_5_1": ("linear sweeps over other ranges", other_sweeps_figure()),
        "figure_5_2": ("u to y, identified set", sets_figure(("identified",), "u", "y")),
        "figure_5_3": ("u to psi, linear sets", sets_figure(linear, "u", "psi")),
        "figure_5_4": ("psi to y, linear sets", sets_figure(linear, "psi", "y")),
        "figure_5_5": ("step of 0.6 A", step_figure()),
        "figure_5_6_5_7": ("responses at all amplitudes", amplitude_figure()),
        "figure_5_8_5_9": ("parameters over amplitude", parameter_figure()),
        "figure_6_6": ("sets R, P, B and ours against the 1 A sweep", bouc_wen_figure()),
        "figure_6_2": ("u to psi, without and with set R", sets_figure(hysteretic, "u", "psi")),
        "figure_6_3": ("psi to y, without and with set R", sets_figure(hysteretic, "psi", "y")),
        "figure_6_7": ("psi to y, sets R, P and B", sets_figure(fitted, "psi", "y")),
        "figure_6_8": ("psi and y over time, sets R, P and B", over_time_figure()),
    }
    table = Table("figure", "shows", "file")
    for name, (shows, figure) in drawn.items():
        with style():
            for ending in ("svg", "png"):
                figure.savefig(out / f"{name}.{ending}", dpi=130)
        table.add_row(name, shows, str(out / f"{name}.svg"))
    for name, parameter in (("figure_6_4", "beta"), ("figure_6_5", "a")):
        run_vary("hysteresis_r", [parameter], out / name, steps=3, amplitude=1.0)
        table.add_row(name, f"set R with another {parameter}, as `rigsight vary` draws it", str(out / name))
    return table


def amplitude_figure() -> Figure:
    """Figures 5.6 and 5.7."""
    columns = []
    for source, response, title in (("u", "psi", "u to psi"), ("psi", "y", "psi to y")):
        responses = {a: OURS.response(measured(thesis_sweep(a)), source, response) for a in AMPLITUDES}
        columns.append(
            [Panel(title, found.band(0.3, 80.0), label=f"{a:.2f} A") for a, found in responses.items()]
        )
    return overlaid_responses(columns)


def parameter_figure() -> Figure:
    """Figures 5.8 and 5.9."""
    published = {s.amplitude: s.parameters for s in published_sets().values() if s.amplitude is not None}
    amplitudes = AMPLITUDES[:4]
    ours, thesis = values_by_amplitude(OURS), values_by_amplitude(THESIS)
    with style():
        figure = Figure(figsize=(10.5, 5.2), layout="constrained")
        axes = figure.subplots(2, 3).ravel()
        for ax, (name, unit) in zip(axes, PARAMETERS.items(), strict=False):
            ax.plot(
                amplitudes, [published[a][name] for a in amplitudes], "ks--", mfc="none", label="published"
            )
            ax.plot(
                amplitudes,
                [thesis[a][name][0] for a in amplitudes],
                "o-",
                color=COLORS[0],
                label="virtual rig, method of the thesis",
            )
            centers, errors = np.array([ours[a][name] for a in amplitudes]).T
            ax.errorbar(
                amplitudes,
                centers,
                1.96 * errors,
                fmt="D-",
                color=COLORS[1],
                capsize=3,
                label="virtual rig, ours, 95 %",
            )
            if name in ("psi_off", "y_off"):
                ax.axhline(
                    VIRTUAL_RIG.parameters[name], color="0.5", linewidth=0.8, linestyle=":", label="truth"
                )
            ax.set_title(f"{name} [{unit}]")
            ax.set_xlabel("amplitude [A]")
            ax.ticklabel_format(axis="y", scilimits=(-2, 4))
            ax.grid()
        axes[-1].set_visible(False)
        handles, labels = axes[3].get_legend_handles_labels()
        figure.legend(handles, labels, loc="lower right", bbox_to_anchor=(0.97, 0.12))
    return figure


def bouc_wen_figure() -> Figure:
    """Figure 6.6: magnitude and phase at 1 A over the frequencies of the calibration."""
    models = {f"set {key}": published_model(f"hysteresis_{key.lower()}") for key in "RPB"}
    models |= {"ours": bouc_wen_of_peak_and_break(), "ours, with an actuator lag": bouc_wen_with_lag()}
    return bode_of(
        band_response(None, 1.0), {name: band_response(model, 1.0) for name, model in models.items()}
    )


def sets_figure(names: Sequence[str], source: str, response: str) -> Figure:
    """Figures 5.2 to 5.4, 6.2, 6.3 and 6.7: published sets against the 1 A sweep of the virtual rig."""
    seen = OURS.response(measured(thesis_sweep(1.0)), source, response).band(0.1, CUTS[response])
    curves = {}
    for name in names:
        record = simulated(*published_model(name), thesis_sweep(1.0))
        curves[name] = simulated_pair(OURS, record, source, response).band(0.1, CUTS[response])
    return bode_of(seen, curves)


def bode_of(seen: FrequencyResponse, curves: Mapping[str, FrequencyResponse]) -> Figure:
    """Draw a measured response and those of models."""
    with style():
        figure = Figure(figsize=(6.4, 5.6), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
        top.semilogx(seen.omega, seen.magnitude_db, ".", markersize=4, color="black", label="virtual rig")
        bottom.semilogx(seen.omega, np.degrees(seen.phase), ".", markersize=4, color="black")
        for (name, curve), color in zip(curves.items(), COLORS, strict=False):
            top.semilogx(curve.omega, curve.magnitude_db, color=color, label=name)
            bottom.semilogx(curve.omega, np.degrees(curve.phase), color=color)
        top.set_ylabel(f"magnitude [dB re 1 {seen.unit}]")
        bottom.set_ylabel("phase [deg]")
        bottom.set_xlabel("angular frequency [rad/s]")
        top.legend(loc="lower left")
        plain_log_ticks(bottom, float(seen.omega[0]), float(seen.omega[-1]))
        for ax in (top, bottom):
            ax.grid()
    return figure


def other_sweeps_figure() -> Figure:
    """Figure 5.1: magnitudes of linear sweeps over other ranges, by the method of the thesis, and the identified set."""
    with style():
        figure = Figure(figsize=(10.0, 4.0), layout="constrained")
        for ax, (source, response) in zip(figure.subplots(1, 2), PAIRS, strict=True):
            for (start, stop), color in zip(((0.63, 63.0), (1e-3, 126.0)), COLORS, strict=False):
                commanded = other_sweep(1.0, start, stop)
                found = THESIS.response(measured(commanded), source, response)
                found = found.band(max(start, 0.3), min(stop, CUTS[response]))
                ax.semilogx(found.omega, found.magnitude_db, color=color, linewidth=0.8, label=commanded.name)
            own = simulated(*published_model("identified"), thesis_sweep(1.0))
            curve = simulated_pair(OURS, own, source, response).band(0.3, CUTS[response])
            ax.semilogx(curve.omega, curve.magnitude_db, color="black", label="identified (published)")
            ax.set_title(f"{source} to {response}")
            ax.set_ylabel(f"magnitude [dB re 1 {curve.unit}]")
            ax.set_xlabel("angular frequency [rad/s]")
            ax.legend(loc="lower left")
            plain_log_ticks(ax, 0.3, CUTS[response])
            ax.grid()
    return figure


def over_time_figure() -> Figure:
    """Figure 6.8: psi and y of the 1 A sweep over time."""
    record = measured(thesis_sweep(1.0))
    shown = (record.t > 100.0) & (record.t < 112.0)
    with style():
        figure = Figure(figsize=(9.0, 5.0), layout="constrained")
        for ax, (name, unit) in zip(
            figure.subplots(2, 1, sharex=True), (("psi", "mrad"), ("y", "mm")), strict=True
        ):
            ax.plot(
                record.t[shown], 1e3 * record[name][shown], color="black", linewidth=1.6, label="virtual rig"
            )
            for key, color in zip("RPB", COLORS, strict=False):
                own = simulated(*published_model(f"hysteresis_{key.lower()}"), thesis_sweep(1.0))
                ax.plot(
                    record.t[shown], 1e3 * own[name][shown], color=color, linewidth=0.9, label=f"set {key}"
                )
            ax.set_ylabel(f"{name} [{unit}]")
            ax.grid()
        ax.set_xlabel("time [s]")
        ax.legend(loc="upper right", ncols=4)
    return figure


def step_figure() -> Figure:
    """Figure 5.5, offsets removed."""
    record = measured(thesis_step())
    models = {
        "reference (published)": published_model("reference"),
        "identified (published)": published_model("identified"),
        "ours, one linear set": joint_linear(),
        "ours, for sweeps and steps": fitted_to_both(),
    }
    shown = (record.t > STEP_START - 0.5) & (record.t < STEP_START + 4.0)
    before = (record.t > STEP_START - 5.0) & (record.t < STEP_START)
    with style():
        figure = Figure(figsize=(7.0, 3.8), layout="constrained")
        ax = figure.subplots()
        ax.plot(
            record.t[shown],
            1e3 * (record["psi"] - record["psi"][before].mean())[shown],
            color="0.4",
            label="virtual rig",
        )
        for (name, model), color in zip(models.items(), COLORS, strict=False):
            psi = simulated(*model, thesis_step())["psi"]
            ax.plot(record.t[shown], 1e3 * (psi - psi[before].mean())[shown], color=color, label=name)
        ax.set_xlabel("time [s]")
        ax.set_ylabel("psi [mrad]")
        ax.legend()
        ax.grid()
    return figure


def write_campaign(folder: Path) -> Table:
    """Write the virtual rig's sweeps and step as a campaign for `rigsight identify` and `rigsight diagnose`."""
    folder.mkdir(parents=True, exist_ok=True)
    records = [measured(thesis_sweep(a)) for a in AMPLITUDES[:4]] + [measured(thesis_step())]
    blocks = [_rig_blocks(CONSTANTS)]
    table = Table("record", "file")
    for record in records:
        file = f"{record.kind}_{record.amplitude:.2f}A.csv"
        _write_csv(folder / file, record)
        blocks.append(
            f'[[records]]\nfile = "{file}"\nrole = "estimation"\nkind = "{record.kind}"\n'
            f'amplitude = {record.amplitude}\nhold = "{record.hold}"\n'
        )
        table.add_row(record.name, str(folder / file))
    (folder / "campaign.toml").write_text("\n".join(blocks), encoding="utf-8")
    return table


def _rig_blocks(constants: Mapping[str, float]) -> str:
    lines = "\n".join(f"{name} = {value}" for name, value in constants.items())
    return f'title = "The thesis on the virtual rig"\n\n[rig]\nmodel = "running_gear"\n\n[rig.constants]\n{lines}\n'


def _write_csv(path: Path, record: Record) -> None:
    columns = np.column_stack([record.t, record["u"], record["psi"], record["y"]])
    np.savetxt(path, columns, fmt="%.9g", delimiter=",", header="t,u,psi,y", comments="")
