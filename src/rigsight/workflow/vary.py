"""The work of `rigsight vary`: a model and a parameter -> how its frequency response changes with the parameter's value."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.effects import Effect
from rigsight.errors import InputError, SimulationError, check_in_range, check_option
from rigsight.frequency import FrequencyResponse
from rigsight.identify.hysteresis import SpectralRatio, break_frequency, fitted_break_frequency, peak
from rigsight.parameters import Parameter
from rigsight.plot.variation import Curve, picture_files, varied_responses
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate import simulate
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.model_file import named_model
from rigsight.workflow.run.kernels import prepare_kernels
from rigsight.workflow.run.progress import Listener, Stage, silent
from rigsight.workflow.run.results import check_writable, json_text, write_together
from rigsight.workflow.run.variation_sweep import MARGIN, Pair, variation_sweep

VARY_FILE = "vary.json"
VARYING = "Sweeping"
SCHEMA_VERSION = 2
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
        ``lowest_gain`` (the magnitude at the lowest frequency), ``peak_omega``, ``peak_magnitude``, ``break_frequency``,
        ``fitted_break_frequency``; None where the band does not show one.
    note
        A remark; empty if there is none.
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
    source: str | None = None,
    response: str | None = None,
    own_effects: Sequence[Effect] = (),
    own_rigs: Iterable[Rig] = (),
    listener: Listener = silent,
) -> tuple[Variation, ...]:
    """Simulate a sweep with several values of each parameter, all others unchanged.

    Parameters
    ----------
    model
        A ``model.json``, the folder that contains one, or the name of a published set.
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
        Angular frequencies [rad/s]; default is about the natural frequency at this amplitude, on a rig of several motions about
        all of its natural frequencies.
    source, response
        Names of the swept input (the others are at rest) and of the output; default is the first of each.
    own_effects, own_rigs
        Effects and rigs that the model may name beside those of the catalogue and the built-in ones.
    listener
        Told of every finished sweep.

    Raises
    ------
    InputError
        If the model or an option cannot be used, or the results cannot be written; nothing is written then.
    """
    if out is not None:
        check_writable(Path(out), VARY_FILE)
    read = named_model(model, own_effects, own_rigs)
    rig = read.structure.rig
    if not rig.is_driven or not rig.inputs:
        why = "prescribes the motion" if rig.inputs else "has no input"
        raise InputError(
            f"'vary' sweeps a rig whose input moves a mass, and {model} is of the rig '{rig.name}', which {why}."
        )
    pair = Pair(
        _signal("--input", source, [signal.name for signal in rig.inputs]),
        _signal("--output", response, [signal.name for signal in rig.outputs]),
    )
    check_in_range("The number of values (--steps)", steps, 2, _MOST_STEPS)
    check_in_range("The amplitude (--amplitude)", amplitude, np.nextafter(0.0, 1.0), 1e12)
    chosen = [_named(read, name) for name in dict.fromkeys(parameters)]
    if not chosen:
        raise InputError(f"Name a parameter to vary. The model has: {', '.join(read.structure.names)}.")
    if len(chosen) > 1 and (low is not None or high is not None):
        raise InputError(
            "--from and --to can be used with one parameter only: name one parameter, or leave them out."
        )
    tries = [_values(p, read.values[p.name], low, high, steps) for p in chosen]
    excitation, ratio = variation_sweep(read, pair, amplitude, band)
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
    """Return the gain at the lowest frequency, peak and break frequency of every value as lines for a terminal."""
    response = next(v.response for v in variation.variants if v.response is not None)
    unit = response.unit
    columns = {
        "lowest_gain": f"gain at {response.omega[0]:.4g} rad/s [{unit}]",
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
    """Return a value with four digits, without an exponent where possible."""
    if 1e-3 <= abs(value) < 1e6:
        return np.format_float_positional(value, precision=4, fractional=False, trim="-")
    return f"{value:.4g}"


def _signal(option: str, wished: str | None, known: Sequence[str]) -> str:
    return known[0] if wished is None else check_option(option, wished, known)


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
        raise InputError(f"'{name}' is 0 in this model, so there is no default range: give --from and --to.")
    for option, value in (("--from", low), ("--to", high)):
        if value is not None:
            check_in_range(
                f"The parameter '{name}' ({option})", value, parameter.lower, parameter.upper, parameter.unit
            )
    least, most = (
        float(np.clip(v, parameter.lower, parameter.upper)) for v in sorted((0.5 * base, 2.0 * base))
    )
    first, last = (least if low is None else low), (most if high is None else high)
    if first >= last:
        told = ", ".join(
            f"{option} {end:g}{' (the default)' if value is None else ''}"
            for option, value, end in (("--from", low, first), ("--to", high, last))
        )
        raise InputError(
            f"The values of '{name}' do not increase: {told}. Give --from and --to, the smaller value first."
        )
    if low is None and high is None and first * last > 0.0:
        values = np.geomspace(abs(first), abs(last), steps) * math.copysign(1.0, first)
    else:
        values = np.linspace(first, last, steps)
    # Exact ends, because rounding must not move a value over its bound.
    values[0], values[-1] = first, last
    return [float(value) for value in values]


def _variant(
    model: Model, parameter: Parameter, value: float, excitation: Record, ratio: SpectralRatio
) -> Variant:
    try:
        simulated = simulate(model.structure, {**model.values, parameter.name: value}, excitation)
    except SimulationError as error:
        return Variant(value, None, {}, str(error))
    output = simulated[ratio.response]
    # The static equilibrium is not part of the response to the sweep.
    moved = output - output[0]
    response = ratio(simulated.with_signals(**{ratio.response: moved}))
    if not np.any(moved):
        still = f"The sweep does not move '{ratio.response}'; give a larger amplitude with --amplitude."
        none = ("peak_omega", "peak_magnitude", "break_frequency", "fitted_break_frequency")
        return Variant(value, response, {"lowest_gain": 0.0, **dict.fromkeys(none)}, still)
    top = peak(response)
    notes = [] if top.is_resonance else ["The magnitude has no peak inside the band."]
    features: dict[str, float | None] = {
        "lowest_gain": float(response.magnitude[0]),
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
    source = next(signal for signal in rig.inputs if signal.name == ratio.source)
    response = next(signal for signal in rig.outputs if signal.name == ratio.response)
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
            "omega_start": MARGIN[0] * float(ratio.omega[0]),
            "omega_stop": MARGIN[1] * float(ratio.omega[-1]),
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
