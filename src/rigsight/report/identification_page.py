"""The identification of a rig of any shape as one self-contained HTML page: no script, no network, nothing beside the file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rigsight.diagnose.result import Estimate
from rigsight.identify import FitResult
from rigsight.identify.identification import HysteresisIdentification, Identification
from rigsight.identify.linear_view import LinearView, Mode
from rigsight.records.record import Floats
from rigsight.report.figures import PageFigure, page_figure
from rigsight.report.identification import derived_rows, error_rows
from rigsight.report.quantities import ERRORS_HOLD, ParameterRow, parameter_row, written
from rigsight.report.render import rendered

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STABLE = {
    "stable": "stable",
    "drifts": "stable except for free rigid-body motion",
    "undamped": "not damped in all of its motions",
    "unstable": "unstable",
}


def render_identification(
    identification: Identification,
    drawings: Sequence[Figure],
    amplitudes: Figure | None,
    command: str,
    versions: Mapping[str, str],
    seed: int | None = None,
) -> str:
    """Return the page of an identification."""
    reported = identification.identifiability
    assert reported is not None
    joint, names = identification.joint, identification.joint.names
    fit, hysteresis = joint.fit.fit, identification.hysteresis
    figure = None
    if amplitudes is not None:
        caption = "Parameters fitted to each record alone, over its amplitude, with 95 % intervals; dashed: the common set."
        figure = page_figure(amplitudes, "amplitudes-figure", identification.amplitude_statement, caption)
    return rendered(
        "identification.html.jinja",
        command or "from Python",
        versions,
        seed,
        identification=identification,
        sentence=reported.sentence,
        all_determined=len(reported.determined) == len(names) and fit.success,
        n_determined=len(reported.determined),
        n_parameters=len(names),
        views=_views(identification, drawings),
        parameters=_parameters(names, fit, identification.units, identification.meanings),
        combinations=[
            parameter_row(c.text, Estimate(c.value, c.std, c.unit), description=f"of {', '.join(c.members)}")
            for c in reported.combinations
        ],
        errors_hold=ERRORS_HOLD,
        outputs=list(dict.fromkeys(name for score in joint.scores for name in score.nrmse)),
        hysteresis=None if hysteresis is None else _hysteresis(hysteresis),
        amplitudes=figure,
    )


def _parameters(
    names: Iterable[str], fit: FitResult, units: Mapping[str, str], meanings: Mapping[str, str]
) -> list[ParameterRow]:
    return [
        parameter_row(
            name,
            Estimate(fit.values[name], fit.standard_errors[name], units.get(name, "")),
            description=meanings.get(name, ""),
        )
        for name in names
    ]


def _hysteresis(found: HysteresisIdentification) -> dict[str, Any]:
    fit = found.calibration.fit
    return {
        "statement": found.statement,
        "parameters": _parameters(fit.free, fit, found.units, found.meanings),
        "held": ", ".join(f"{name} = {value:.4g}" for name, value in found.held.items()),
        "derived": list(derived_rows(found)),
        "errors": list(error_rows(found)),
    }


def _views(identification: Identification, drawings: Sequence[Figure]) -> list[dict[str, Any]]:
    found, remaining = [], iter(drawings)
    for number, view in enumerate(identification.views, 1):
        found.append(
            {
                "title": ", ".join(f"{name} = {value:g}" for name, value in view.constants.items()),
                "figure": None if view.measured is None else _figure(view, next(remaining), number),
                "problems": []
                if view.measured is None
                else [
                    f"{source} \u2192 {response}: {problem}"
                    for (source, response), problem in view.measured.problems.items()
                ],
                "modes": [_mode(mode) for mode in view.modes],
                "stability": _STABLE[view.linearization.stability],
                "at": _place(view),
                "transfer_functions": [
                    _transfer_function(view, source, response)
                    for source in view.linearization.inputs
                    for response in view.linearization.outputs
                ],
            }
        )
    return found


def _figure(view: LinearView, drawing: Figure, number: int) -> PageFigure:
    shown = "; ".join(
        f"{source} to {response}: peak {20.0 * math.log10(float(curve.magnitude.max())):.3g} dB at "
        f"{float(curve.omega[int(np.argmax(curve.magnitude))]):.3g} rad/s"
        for (source, response), curve in (view.measured.found if view.measured else {}).items()
    )
    caption = (
        "Magnitude and phase of each sensor's response to each input: measured from all records together (gray, with 95 % "
        "bands), and that of the fitted equations, linearized at equilibrium (blue)."
    )
    return page_figure(
        drawing, f"responses-{number}", shown or "No frequency response was measured.", caption
    )


def _place(view: LinearView) -> str:
    linear = view.linearization
    pairs = [
        *zip(linear.inputs, linear.at_inputs, strict=True),
        *zip(linear.states, linear.at_state, strict=True),
    ]
    return ", ".join(f"{name} = {float(value):.4g}" for name, value in pairs if value != 0.0) or "all at zero"


def _mode(mode: Mode) -> dict[str, Any]:
    real, imaginary = mode.pole.real, mode.pole.imag
    return {
        "pole": (f"{real:.4g} \u00b1 {imaginary:.4g} i" if imaginary else f"{real:.4g}").replace(
            "-", "\u2212"
        ),
        "frequency": written(mode.natural_frequency, mode.frequency_std),
        "damping": None
        if not math.isfinite(mode.damping_ratio)
        else written(mode.damping_ratio, mode.damping_std),
    }


def _transfer_function(view: LinearView, source: str, response: str) -> dict[str, str]:
    found = view.linearization.transfer_function(source, response)
    return {
        "path": f"{source} \u2192 {response}",
        "numerator": _polynomial(found.numerator),
        "denominator": _polynomial(found.denominator),
    }


def _polynomial(coefficients: Floats) -> str:
    degree = coefficients.size - 1
    parts = [
        (value, f"{abs(value):.4g}{' s' if power else ''}{f'^{power}' if power > 1 else ''}")
        for power, value in zip(range(degree, -1, -1), map(float, coefficients), strict=True)
        if value != 0.0
    ]
    if not parts:
        return "0"
    signs = ["\u2212" if value < 0.0 else "+" for value, _ in parts]
    first = f"{signs[0].replace('+', '')}{parts[0][1]}"
    return first + "".join(f" {sign} {text}" for sign, (_, text) in zip(signs[1:], parts[1:], strict=True))
