"""The identification of a rig of any shape as one self-contained HTML page: no script, no network, nothing beside the file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rigsight.identify.identification import HysteresisIdentification, Identification
from rigsight.identify.linear_view import LinearView, Mode
from rigsight.report.drawing.figures import PageFigure, page_figure
from rigsight.report.identification import derived_rows, error_rows
from rigsight.report.quantities import ERRORS_HOLD, UNDETERMINED, Written, gap_percent, written
from rigsight.report.render import environment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TWO_SIDED = 1.96
"""Standard deviations of a 95 % interval."""
_STABLE = {
    "stable": "stable",
    "drifts": "stable except for free rigid-body motion",
    "undamped": "not damped in all of its motions",
    "unstable": "unstable",
}


@dataclass(frozen=True)
class ParameterRow:
    """One parameter, or combination of some, in the page; a remark stands where the records do not determine it."""

    name: str
    number: Written
    interval: tuple[Written, ...]
    unit: str
    description: str
    remark: str = ""


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
    names = identification.joint.names
    return (
        environment()
        .get_template("identification.html.jinja")
        .render(
            identification=identification,
            sentence=reported.sentence,
            all_determined=len(reported.determined) == len(names) and identification.joint.fit.fit.success,
            n_determined=len(reported.determined),
            n_parameters=len(names),
            views=_views(identification, drawings),
            parameters=[_parameter(identification, name) for name in names],
            combinations=[
                _row(c.text, c.value, c.std, c.unit, f"of {', '.join(c.members)}")
                for c in reported.combinations
            ],
            errors_hold=ERRORS_HOLD,
            statements=reported.statements,
            outputs=list(dict.fromkeys(name for s in identification.joint.scores for name in s.nrmse)),
            scores=[
                {
                    "record": score.record,
                    "role": score.role,
                    "joint": {name: gap_percent(value) for name, value in score.nrmse.items()},
                    "own": {name: gap_percent(value) for name, value in score.own_nrmse.items()},
                }
                for score in identification.joint.scores
            ],
            hysteresis=None if identification.hysteresis is None else _hysteresis(identification.hysteresis),
            amplitudes=None
            if amplitudes is None
            else page_figure(
                amplitudes,
                "amplitudes-figure",
                identification.amplitude_statement,
                "Parameters fitted to each record alone, over its amplitude, with 95 % intervals; dashed: the common set.",
            ),
            command=command or "from Python",
            versions=versions,
            seed=seed,
            made=datetime.now(UTC),
        )
    )


def _hysteresis(found: HysteresisIdentification) -> dict[str, Any]:
    fit = found.calibration.fit
    return {
        "statement": found.statement,
        "parameters": [
            _row(name, fit.values[name], fit.standard_errors[name], found.units[name], found.meanings[name])
            for name in fit.free
        ],
        "held": ", ".join(f"{name} = {value:.4g}" for name, value in found.held.items()),
        "derived": list(derived_rows(found)),
        "errors": list(error_rows(found)),
    }


def _views(identification: Identification, drawings: Sequence[Figure]) -> list[dict[str, Any]]:
    found, left = [], list(drawings)
    for number, view in enumerate(identification.views, 1):
        found.append(
            {
                "title": ", ".join(f"{name} = {value:g}" for name, value in view.constants.items()),
                "figure": None if view.measured is None else _figure(view, left.pop(0), number),
                "problems": [] if view.measured is None else _problems(view),
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


def _problems(view: LinearView) -> list[str]:
    assert view.measured is not None
    return [
        f"{source} \u2192 {response}: {problem}"
        for (source, response), problem in view.measured.problems.items()
    ]


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


def _polynomial(coefficients: NDArray[np.float64]) -> str:
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


def _parameter(identification: Identification, name: str) -> ParameterRow:
    fit = identification.joint.fit.fit
    unit, meaning = identification.units.get(name, ""), identification.meanings.get(name, "")
    return _row(name, fit.values[name], fit.standard_errors[name], unit, meaning)


def _row(name: str, value: float, std: float, unit: str, description: str) -> ParameterRow:
    if not math.isfinite(std):
        return ParameterRow(name, written(value), (), unit, description, UNDETERMINED)
    ends = tuple(written(end, std) for end in (value - _TWO_SIDED * std, value + _TWO_SIDED * std))
    interval = tuple(Written(end.value, "", end.exponent) for end in ends)
    return ParameterRow(name, written(value, std), interval, unit, description)
