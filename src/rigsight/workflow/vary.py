"""What `rigsight vary` does: a model and a parameter -> how its frequency response changes with the parameter's value."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.errors import InputError, SimulationError, check_in_range, check_option
from rigsight.excitation import log_sweep
from rigsight.frequency import FrequencyResponse
from rigsight.identify.hysteresis import SpectralRatio, break_frequency, fitted_break_frequency, peak
from rigsight.parameters import Parameter
from rigsight.plot.variation import Curve, picture_files, varied_responses
from rigsight.records import Record
from rigsight.rigs import evaluated
from rigsight.simulate import parameter_vector, rest_state, simulate
from rigsight.simulate.input_hold import hold_input
from rigsight.simulate.model import Model
from rigsight.workflow.kernels import prepare_kernels
from rigsight.workflow.model_file import named_model
from rigsight.workflow.not_yet import check_takes
from rigsight.workflow.progress import Listener, Stage, silent
from rigsight.workflow.results import check_writable, json_text, write_together

VARY_FILE = "vary.json"
VARYING = "Sweeping"
SCHEMA_VERSION = 1
_BAND = (1.0 / 12.0, 6.0)
"""Ends of the band over the natural frequency at the amplitude of the sweep."""
_MARGIN = (0.5, 1.6)
"""Factors by which the sweep reaches beyond the band."""
_GROWTH = math.log(640.0 / 1e-3) / 150.0 / 12.0
"""Rate of the thesis's sweep (section 4.2) per radian of the identified natural frequency, e-folds per radian."""
_SAMPLES_PER_PERIOD = 10.0
"""At the end of the sweep."""
_N_FREQUENCIES = 96
_MOST_STEPS = 50


@dataclass(frozen=True, eq=False)
class Variant:
    """The model with one value of one parameter.

    Attributes
    ----------
    value
        The parameter's value.
    response
        Frequency response, None where the model cannot be simulated with it.
    features
        ``static_gain``, ``peak_omega``, ``peak_magnitude``, ``break_frequency``, ``fitted_break_frequency``; None where the
        band does not show one.
    note
        What to know about it; empty where all is well.
    """

    value: float
    response: FrequencyResponse | None
    features: dict[str, float | None]
    note: str


@dataclass(frozen=True, eq=False)
class Variation:
    """All values of one parameter."""

    parameter: Parameter
    base: float
    variants: tuple[Variant, ...]


def run_vary(
    model: str | Path,
    parameters: Sequence[str],
    out: str | Path | None = None,
    *,
    low: float | None = None,
    high: float | None = None,
    steps: int = 5,
    amplitude: float = 1.0,
    band: tuple[float, float] | None = None,
    listener: Listener = silent,
) -> tuple[Variation, ...]:
    """Sweep a model with several values of each parameter, all others as they are.

    Parameters
    ----------
    model
        A ``model.json``, the folder that holds one, or the name of a published set.
    parameters
        Names of parameters of the model.
    out
        Folder for ``vary.json`` and one picture per parameter; None writes nothing.
    low, high
        Ends of the values; default is half and twice the model's.
    steps
        Number of values, 2 to 50.
    amplitude
        Amplitude of the sweep, in the unit of the input.
    band
        Angular frequencies [rad/s]; default is about the natural frequency at this amplitude.
    listener
        Told of every finished sweep.

    Raises
    ------
    InputError
        If the model or an option cannot be used, or the results cannot be written; nothing is written then.
    """
    if out is not None:
        check_writable(Path(out))
    read = named_model(model)
    check_takes("vary", read.structure.rig)
    if not read.structure.rig.is_driven:
        raise InputError(
            f"'vary' sweeps a rig whose input moves a mass, and {model} is of the rig '{read.structure.rig.name}', which "
            "prescribes the motion. Use a model of a driven rig."
        )
    check_in_range("The number of values (--steps)", steps, 2, _MOST_STEPS)
    check_in_range("The amplitude (--amplitude)", amplitude, np.nextafter(0.0, 1.0), 1e12)
    chosen = [_named(read, name) for name in dict.fromkeys(parameters)]
    if not chosen:
        raise InputError(f"Name a parameter to vary. The model has: {', '.join(read.structure.names)}.")
    if len(chosen) > 1 and (low is not None or high is not None):
        raise InputError("--from and --to belong to one parameter: name one, or leave them out.")
    tries = [_values(p, read.values[p.name], low, high, steps) for p in chosen]
    excitation, ratio = _sweep(read, amplitude, band)
    prepare_kernels([read.structure], 1, listener)
    stage = Stage(VARYING, sum(len(values) for values in tries), listener)
    variations = []
    for parameter, values in zip(chosen, tries, strict=True):
        variants = []
        for value in values:
            variants.append(_variant(read, parameter, value, excitation, ratio))
            stage.finished(f"{parameter.name} = {value:.4g}")
        if all(variant.response is None for variant in variants):
            raise InputError(
                f"No value of '{parameter.name}' can be simulated. {variants[0].note} Try other values with --from and --to."
            )
        variations.append(Variation(parameter, read.values[parameter.name], tuple(variants)))
    if out is not None:
        _write(Path(out), str(model), read, variations, excitation, ratio, amplitude)
    return tuple(variations)


def table_text(variation: Variation) -> str:
    """Return static gain, peak and break frequency of every value as lines for a terminal."""
    unit = next(v.response.unit for v in variation.variants if v.response is not None)
    columns = {
        "static_gain": f"gain [{unit}]",
        "peak_magnitude": f"peak [{unit}]",
        "peak_omega": "at [rad/s]",
        "break_frequency": "break [rad/s]",
    }
    named = f"{variation.parameter.name} [{variation.parameter.unit or '1'}]"
    rows = [[named, *columns.values()]]
    for variant in variation.variants:
        cells = [variant.features.get(key) for key in columns]
        rows.append([_plain(variant.value), *("-" if cell is None else f"{cell:.4g}" for cell in cells)])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    notes = [f"{_plain(v.value)}: {v.note}" for v in variation.variants if v.note]
    return "\n".join([*lines, *notes])


def _plain(value: float) -> str:
    """Return four digits as people write them."""
    if 1e-3 <= abs(value) < 1e6:
        return np.format_float_positional(value, precision=4, fractional=False, trim="-")
    return f"{value:.4g}"


def _named(model: Model, name: str) -> Parameter:
    known = {p.name: p for p in model.structure.parameters}
    parameter = known[check_option("The parameter (--parameter)", name, known)]
    return model.structure.rig.with_unit(parameter) if not parameter.unit else parameter


def _values(
    parameter: Parameter, base: float, low: float | None, high: float | None, steps: int
) -> list[float]:
    """Return the values to sweep, increasing: evenly spaced, or by equal factors where nothing was given."""
    name = parameter.name
    if base == 0.0 and (low is None or high is None):
        raise InputError(f"'{name}' is 0 in this model, so half and twice are 0 too: give --from and --to.")
    first, last = (0.5 * base if low is None else low), (2.0 * base if high is None else high)
    for option, value in (("--from", low), ("--to", high)):
        if value is not None:
            check_in_range(
                f"The parameter '{name}' ({option})", value, parameter.lower, parameter.upper, parameter.unit
            )
    first, last = (float(np.clip(v, parameter.lower, parameter.upper)) for v in sorted((first, last)))
    if first == last:
        raise InputError(f"--from and --to give '{name}' only one value, {first:g}: give two different ones.")
    if low is None and high is None and first * last > 0.0:
        values = np.geomspace(abs(first), abs(last), steps) * math.copysign(1.0, first)
    else:
        values = np.linspace(first, last, steps)
    # The ends exactly: rounding must not push a value over its bound.
    values[0], values[-1] = first, last
    return [float(value) for value in values]


def _sweep(model: Model, amplitude: float, band: tuple[float, float] | None) -> tuple[Record, SpectralRatio]:
    rig = model.structure.rig
    if band is None:
        natural = _natural_frequency(model, amplitude)
        band = (_BAND[0] * natural, _BAND[1] * natural)
    if not 0.0 < band[0] < band[1] < math.inf:
        raise InputError(
            f"The band needs 0 < lowest < highest, got {band[0]:g} and {band[1]:g} rad/s (--lowest, --highest)."
        )
    start, stop = _MARGIN[0] * band[0], _MARGIN[1] * band[1]
    dt = 2.0 * math.pi / (_SAMPLES_PER_PERIOD * stop)
    duration = math.log(stop / start) / (
        _GROWTH * math.sqrt(band[0] * band[1]) / math.sqrt(_BAND[0] * _BAND[1])
    )
    t = dt * np.arange(round(duration / dt) + 1, dtype=np.float64)
    source, response = rig.inputs[0], rig.outputs[0]
    record = Record(
        name=f"sweep of {amplitude:g} {source.unit}",
        dt=dt,
        signals={source.name: log_sweep(t, amplitude, start, stop)},
        units={source.name: source.unit, response.name: response.unit},
        kind="sweep",
        amplitude=amplitude,
        hold=model.hold,
    )
    return record, SpectralRatio(source.name, response.name, np.geomspace(*band, _N_FREQUENCIES))


def _natural_frequency(model: Model, amplitude: float) -> float:
    """Return the natural frequency [rad/s] with the stiffness that holds a constant input of this amplitude.

    A hysteretic spring is much stiffer for small motion than where the resonance of a sweep lies.
    """
    motion = model.structure.rig.motion
    drive, stiffness, inertia, rest = (
        evaluated(part, model.values)
        for part in (motion.drive_gain, motion.stiffness, motion.inertia, motion.rest)
    )
    if stiffness <= 0.0:
        raise InputError(
            "The model has no spring and so no natural frequency: give the band with --lowest and --highest [rad/s]."
        )
    held = hold_input(np.full(3, amplitude), 1.0, "zoh")
    with contextlib.suppress(SimulationError):
        state = rest_state(model.structure, parameter_vector(model.structure, model.values), held)
        secant = drive * amplitude / (float(state[0]) - rest)
        if 0.0 < secant < math.inf:
            stiffness = secant
    return math.sqrt(stiffness / inertia)


def _variant(
    model: Model, parameter: Parameter, value: float, excitation: Record, ratio: SpectralRatio
) -> Variant:
    try:
        simulated = simulate(model.structure, {**model.values, parameter.name: value}, excitation)
    except SimulationError as error:
        return Variant(value, None, {}, str(error))
    response = ratio(simulated)
    top = peak(response)
    notes = [] if top.is_resonance else ["The magnitude has no peak inside the band."]
    features: dict[str, float | None] = {
        "static_gain": float(response.magnitude[0]),
        "peak_omega": top.omega if top.is_resonance else None,
        "peak_magnitude": top.magnitude if top.is_resonance else None,
    }
    for name, read_off in (
        ("break_frequency", break_frequency),
        ("fitted_break_frequency", fitted_break_frequency),
    ):
        try:
            features[name] = read_off(response)
        except InputError as error:
            features[name] = None
            notes.append(str(error))
    return Variant(value, response, features, " ".join(notes))


def _write(
    folder: Path,
    name: str,
    model: Model,
    variations: Sequence[Variation],
    excitation: Record,
    ratio: SpectralRatio,
    amplitude: float,
) -> None:
    rig = model.structure.rig
    source, response = rig.inputs[0], rig.outputs[0]
    contents: dict[str, str | bytes] = {}
    pictures = {}
    for variation in variations:
        parameter = variation.parameter
        stem = "vary" if len(variations) == 1 else f"vary_{parameter.name}"
        figure = varied_responses(
            ratio.omega,
            _curves(variation),
            f"{source.name} \u2192 {response.name}",
            _unit(source.unit, response.unit),
            f"{name} with other {parameter.name}, sweep of {amplitude:g} {source.unit}",
        )
        pictures[parameter.name] = f"{stem}.svg"
        contents |= {f"{stem}.{ending}": content for ending, content in picture_files(figure).items()}
    content: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "model": name,
        "rig": rig.name,
        "effects": list(model.structure.effect_names),
        "source": source.name,
        "response": response.name,
        "unit": _unit(source.unit, response.unit),
        "sweep": {
            "amplitude": amplitude,
            "duration": excitation.duration,
            "dt": excitation.dt,
            "omega_start": _MARGIN[0] * float(ratio.omega[0]),
            "omega_stop": _MARGIN[1] * float(ratio.omega[-1]),
        },
        "omega": [float(omega) for omega in ratio.omega],
        "parameters": [
            {
                "name": variation.parameter.name,
                "unit": variation.parameter.unit,
                "base": variation.base,
                "picture": pictures[variation.parameter.name],
                "values": [_row(variant) for variant in variation.variants],
            }
            for variation in variations
        ],
    }
    write_together(folder, {**contents, VARY_FILE: json_text(content)})


def _row(variant: Variant) -> dict[str, Any]:
    curve: Mapping[str, list[float]] = {}
    if variant.response is not None:
        curve = {
            "magnitude": [float(value) for value in variant.response.magnitude],
            "phase": [float(value) for value in variant.response.phase],
        }
    return {"value": variant.value, **variant.features, "note": variant.note, **curve}


def _curves(variation: Variation) -> list[Curve]:
    unit = "" if variation.parameter.unit in ("", "1") else f" {variation.parameter.unit}"
    return [
        Curve(
            f"{variation.parameter.name} = {_plain(variant.value)}{unit}",
            variant.response.values,
            is_base=math.isclose(variant.value, variation.base, rel_tol=1e-9),
        )
        for variant in variation.variants
        if variant.response is not None
    ]


def _unit(source: str, response: str) -> str:
    return response if source in ("", "1") else f"{response}/{source}"
