"""How do the figures of the thesis look on the virtual rig?"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from calibration import OMEGA, band_response, bouc_wen_of_peak_and_break, fitted_to_both, joint_linear
from matplotlib.figure import Figure
from measuring import OURS, THESIS
from parameter_tables import values_by_amplitude
from rich.table import Table
from virtual_rig import (
    AMPLITUDES,
    CONSTANTS,
    STEP_START,
    VIRTUAL_RIG,
    measured,
    published_model,
    simulated,
    thesis_step,
    thesis_sweep,
)

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
    drawn = {
        "figure_5_5": ("step of 0.6 A", step_figure()),
        "figure_5_6_5_7": ("responses at all amplitudes", amplitude_figure()),
        "figure_5_8_5_9": ("parameters over amplitude", parameter_figure()),
        "figure_6_6": ("sets R, P, B and ours against the 1 A sweep", bouc_wen_figure()),
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
    """Figure 6.6: magnitude and phase at 1 A."""
    models = {f"set {key}": published_model(f"hysteresis_{key.lower()}") for key in "RPB"}
    models["ours"] = bouc_wen_of_peak_and_break()
    curves = {
        "virtual rig": band_response(None, 1.0),
        **{k: band_response(m, 1.0) for k, m in models.items()},
    }
    with style():
        figure = Figure(figsize=(6.4, 5.6), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
        for (name, curve), color in zip(curves.items(), ("black", *COLORS), strict=False):
            line = "." if name == "virtual rig" else "-"
            top.semilogx(OMEGA, curve.magnitude_db, line, color=color, label=name)
            bottom.semilogx(OMEGA, np.degrees(curve.phase), line, color=color)
        top.set_ylabel("magnitude [dB re 1 rad/A]")
        bottom.set_ylabel("phase [deg]")
        bottom.set_xlabel("angular frequency [rad/s]")
        top.legend(loc="lower left")
        plain_log_ticks(bottom, OMEGA[0], OMEGA[-1])
        for ax in (top, bottom):
            ax.grid()
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
