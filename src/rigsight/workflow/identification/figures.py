"""The figures of an identification and their files."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from rigsight.identify.identification import Identification, PathIdentification, RecordIdentification
from rigsight.identify.linear_view import LinearView
from rigsight.plot import (
    AmplitudePanel,
    AmplitudePoint,
    FittedCurve,
    Panel,
    amplitude_dependence,
    bode,
    overlaid_responses,
    response_grid,
    svg_text,
    with_unit,
)
from rigsight.units import behind

if TYPE_CHECKING:
    from rigsight.plot import Figure

AMPLITUDES_FILE = "amplitudes.svg"
RESPONSES_FILE = "responses.svg"
_GRID = 600


def identification_figures(identification: Identification) -> dict[str, tuple[str, str]]:
    """Return file name -> what the figure shows, and the figure as SVG."""
    found: dict[str, tuple[str, Figure]] = {}
    by_record = _is_by_record(identification)
    for number, view in enumerate(() if by_record else identification.views, 1):
        if view.has_responses:
            file = RESPONSES_FILE if number == 1 else f"responses_{number}.svg"
            what = (
                "Responses of every sensor to every input, measured against the linearized model, 95 % bands"
            )
            if view.constants:
                what += f", records with {view.constants_text}"
            found[file] = (what, view_figure(view, identification.units))
    for record in identification.records if by_record else ():
        drawing = bode_figure(record, identification)
        if drawing is not None:
            file = _free_name("bode_" + re.sub(r"[^\w.-]+", "_", record.record.name), found)
            what = f"Bode plot of record '{record.record.name}', measured against fitted, 95 % bands"
            found[file] = (what, drawing)
    drawing = responses_figure(identification) if by_record else None
    if drawing is not None:
        what = "Magnitudes of all records in one plot, measured and fitted (as Figures 5.6 and 5.7 of the thesis)"
        found[RESPONSES_FILE] = (what, drawing)
    drawing = amplitudes_figure(identification)
    if drawing is not None:
        what = "Parameters of each record over its amplitude, with 95 % intervals (as Figures 5.8 and 5.9 of the thesis)"
        found[AMPLITUDES_FILE] = (what, drawing)
    return {file: (what, svg_text(drawing, file)) for file, (what, drawing) in found.items()}


def _is_by_record(identification: Identification) -> bool:
    """Return True if records have curves of their own (PT2 and PT1, or a dynamic stiffness), or only measured ones."""
    paths = [path for record in identification.records for path in record.paths]
    common = any(view.measured is not None for view in identification.views)
    return not common or any(fitted_curve(path) is not None for path in paths)


def bode_figure(record: RecordIdentification, identification: Identification) -> Figure | None:
    """Return the Bode plot of one record, measured against fitted; None where it has no frequency response."""
    chained = {path.source for path in record.paths} & {path.response for path in record.paths}
    if not (_is_by_record(identification) or chained):
        measured = {(path.source, path.response): path.measured for path in record.paths}
        return response_grid(measured, {}, identification.units) if measured else None
    panels = _panels(record, identification)
    return bode(panels) if panels else None


def responses_figure(identification: Identification) -> Figure | None:
    """Return the magnitudes of all records over each other; None where there are none."""
    # Of a rig of several inputs or sensors it is the grid of their responses, all records together.
    if not _is_by_record(identification):
        views = [view for view in identification.views if view.has_responses]
        return view_figure(views[0], identification.units) if views else None
    columns = _columns(identification)
    return overlaid_responses(columns) if columns else None


def view_figure(view: LinearView, units: Mapping[str, str]) -> Figure:
    """Return the grid of the responses of every sensor to every input, measured against the linearized model."""
    assert view.measured is not None
    linear, measured = view.linearization, view.measured
    paths = [(source, response) for response in linear.outputs for source in linear.inputs]
    bands = [curve.omega for curve in measured.found.values()]
    omega = np.geomspace(min(b[0] for b in bands), max(b[-1] for b in bands), _GRID) if bands else np.zeros(0)
    model = {}
    for row, response in enumerate(linear.outputs if omega.size else ()):
        for column, source in enumerate(linear.inputs):
            known = view.model.get((source, response))
            values, std = linear.frequency_response(omega)[:, row, column], np.zeros(omega.size)
            if known is not None:
                # Standard errors change slowly beside the response itself.
                std = np.interp(omega, measured.found[source, response].omega, known[1])
            model[source, response] = FittedCurve(omega, values, std, "linearized model")
    return response_grid({path: measured.found.get(path) for path in paths}, model, units)


def amplitudes_figure(identification: Identification) -> Figure | None:
    """Return the parameters of each record over its amplitude; None where no record gave any."""
    if identification.identifiability is not None and len({r.source for r in identification.records}) > 1:
        # Amplitudes of different inputs have no axis in common.
        return None
    parameters = _parameters(identification)
    source = identification.records[0].source
    label = with_unit(f"amplitude of {source}", identification.units.get(source, ""))
    return amplitude_dependence(parameters, label) if parameters else None


def _free_name(stem: str, taken: Iterable[str]) -> str:
    """Return a file name that differs from the others also where case does not count."""
    used = {name.lower() for name in taken}
    count, name = 1, f"{stem}.svg"
    while name.lower() in used:
        count += 1
        name = f"{stem}_{count}.svg"
    return name


def _panels(found: RecordIdentification, identification: Identification) -> list[Panel]:
    unit = behind(identification.units.get(found.source, ""))
    alone = [r for r in identification.records if math.isclose(r.amplitude, found.amplitude, rel_tol=1e-6)]
    label = f"{found.amplitude:.3g}{unit}"
    label = label if len(alone) == 1 else f"{label}, {found.record.name}"
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
        if not {"k", "d"} <= physical.values.keys():
            return None
        # The dynamic stiffness of an element.
        values = physical.values["k"] + 1j * omega * physical.values["d"]
        errors = physical.standard_errors
        std = np.hypot(errors["k"], omega * errors["d"])
        return FittedCurve(omega, values, std, "k + j\u03c9 d")
    label = f"{fit.form.order.upper()} fit, 95 % band"
    return FittedCurve(omega, fit.at(omega), fit.standard_error_at(omega), label)


def _parameters(identification: Identification) -> list[AmplitudePanel]:
    joint = identification.joint
    names = dict.fromkeys(name for record in identification.records for name in record.estimates)
    panels = []
    for name in names:
        points = tuple(
            AmplitudePoint(record.amplitude, record.record.kind, *record.estimates[name])
            for record in identification.records
            # A fit over time may leave a parameter at its start value.
            if name in record.estimates and (record.own is None or math.isfinite(record.estimates[name][1]))
        )
        if not points:
            continue
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
