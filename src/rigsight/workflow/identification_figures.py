"""Which figures does an identification leave, and in which files?"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from rigsight.identify.identification import Identification, PathIdentification, RecordIdentification
from rigsight.plot import (
    AmplitudePanel,
    AmplitudePoint,
    FittedCurve,
    Panel,
    amplitude_dependence,
    bode,
    overlaid_responses,
    svg_text,
)

if TYPE_CHECKING:
    from rigsight.plot import Figure

AMPLITUDES_FILE = "amplitudes.svg"
RESPONSES_FILE = "responses.svg"
_GRID = 600
_FORMS = {"pt1": "PT1", "pt2": "PT2"}


def identification_figures(identification: Identification) -> dict[str, tuple[str, str]]:
    """Return file name -> what the figure shows, and the figure as SVG.

    Parameters
    ----------
    identification
        The result.
    """
    found: dict[str, tuple[str, str]] = {}
    for record in identification.records:
        drawing = bode_figure(record, identification)
        if drawing is not None:
            file = _free_name(f"bode_{_plain(record.record.name)}", found)
            what = f"Bode plot of record '{record.record.name}', measured against fitted, 95 % bands"
            found[file] = (what, svg_text(drawing, file))
    drawing = responses_figure(identification)
    if drawing is not None:
        what = "Magnitudes of all records over each other, measured and fitted (as the thesis's Figures 5.6 and 5.7)"
        found[RESPONSES_FILE] = (what, svg_text(drawing, RESPONSES_FILE))
    drawing = amplitudes_figure(identification)
    if drawing is not None:
        what = "Parameters of each record over its amplitude, with 95 % intervals (as the thesis's Figures 5.8 and 5.9)"
        found[AMPLITUDES_FILE] = (what, svg_text(drawing, AMPLITUDES_FILE))
    return found


def bode_figure(record: RecordIdentification, identification: Identification) -> Figure | None:
    """Return the Bode plot of one record, measured against fitted; None where it has no frequency response."""
    panels = _panels(record, identification)
    return bode(panels) if panels else None


def responses_figure(identification: Identification) -> Figure | None:
    """Return the magnitudes of all records over each other; None where there are none."""
    columns = _columns(identification)
    return overlaid_responses(columns) if columns else None


def amplitudes_figure(identification: Identification) -> Figure | None:
    """Return the parameters of each record over its amplitude; None where no record gave any."""
    parameters = _parameters(identification)
    return amplitude_dependence(parameters, _amplitude_label(identification)) if parameters else None


def _plain(name: str) -> str:
    return re.sub(r"[^\w.-]+", "_", name)


def _free_name(stem: str, taken: Iterable[str]) -> str:
    """Return a file name that differs from the others also where case does not count."""
    used = {name.lower() for name in taken}
    count, name = 1, f"{stem}.svg"
    while name.lower() in used:
        count += 1
        name = f"{stem}_{count}.svg"
    return name


def _panels(found: RecordIdentification, identification: Identification) -> list[Panel]:
    label = _amplitude_text(found, identification)
    return [
        Panel(f"{path.source} \u2192 {path.response}", path.measured, fitted_curve(path), label)
        for path in found.paths
        if path.measured is not None
    ]


def _columns(identification: Identification) -> list[list[Panel]]:
    ordered = sorted(identification.records, key=lambda r: r.amplitude)
    panels = [panel for record in ordered for panel in _panels(record, identification)]
    return [[p for p in panels if p.title == title] for title in dict.fromkeys(p.title for p in panels)]


def fitted_curve(path: PathIdentification) -> FittedCurve | None:
    """Return the fitted response of a path over the band that was measured, None where nothing was fitted."""
    measured, fit, physical = path.measured, path.fit, path.physical
    if measured is None or physical is None:
        return None
    omega = np.geomspace(measured.omega[0], measured.omega[-1], _GRID)
    if fit is None:
        # The dynamic stiffness of an element.
        values = physical.values["k"] + 1j * omega * physical.values["d"]
        errors = physical.standard_errors
        std = np.hypot(errors["k"], omega * errors["d"])
        return FittedCurve(omega, values, std, "k + j\u03c9 d")
    values, std = fit.at(omega), fit.standard_error_at(omega)
    label = f"{_FORMS[fit.form.order]} fit, 95 % band"
    if fit.response != path.response:
        # Fitted to the velocity.
        values, std = values / (1j * omega), std / omega
        label = f"{label}, of the velocity"
    return FittedCurve(omega, values, std, label)


def _amplitude_text(found: RecordIdentification, identification: Identification) -> str:
    unit = identification.units.get(found.motion.source, "")
    alone = [r for r in identification.records if math.isclose(r.amplitude, found.amplitude, rel_tol=1e-6)]
    text = f"{found.amplitude:.3g} {unit}".strip()
    return text if len(alone) == 1 else f"{text}, {found.record.name}"


def _amplitude_label(identification: Identification) -> str:
    source = identification.records[0].motion.source
    unit = identification.units.get(source, "")
    return f"amplitude of {source}" + (f" [{unit}]" if unit else "")


def _parameters(identification: Identification) -> list[AmplitudePanel]:
    joint = identification.joint
    names = dict.fromkeys(name for record in identification.records for name in record.estimates)
    panels = []
    for name in names:
        points = tuple(
            AmplitudePoint(record.amplitude, record.record.kind, *record.estimates[name])
            for record in identification.records
            if name in record.estimates
        )
        common = None
        if name in joint.names:
            common = (joint.fit.fit.values[name], joint.fit.fit.standard_errors[name])
        elif joint.pooled is not None and name in joint.pooled.names:
            common = (joint.pooled.values[name], joint.pooled.standard_errors[name])
        panels.append(AmplitudePanel(name, identification.units.get(name, ""), points, common))
    resonances = tuple(
        AmplitudePoint(record.amplitude, record.record.kind, record.resonance, math.nan)
        for record in identification.records
        if record.resonance is not None
    )
    if resonances:
        panels.append(AmplitudePanel("resonance seen", "rad/s", resonances))
    return panels
