"""The work of `rigsight vary`: a model and a parameter -> how its frequency response changes with the parameter's value."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect
from rigsight.errors import InputError, SimulationError, check_in_range, check_option
from rigsight.frequency import FrequencyResponse
from rigsight.frequency.signal_pair import pair_unit
from rigsight.identify.hysteresis import SpectralRatio, break_frequency, fitted_break_frequency, peak
from rigsight.json_data import json_data
from rigsight.parameters import Parameter
from rigsight.plot import png_bytes, svg_text
from rigsight.plot.frequency_responses import varied_responses
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate import Model, Structure, simulate, without_vanished_effects
from rigsight.simulate.linearization import is_linear, linearize
from rigsight.units import behind
from rigsight.workflow.campaign.model_file import named_model
from rigsight.workflow.run.kernels import prepare_kernels
from rigsight.workflow.run.progress import Listener, Stage, silent
from rigsight.workflow.run.results import check_writable, json_text, write_together
from rigsight.workflow.run.variation_sweep import MARGIN, Pair, variation_sweep

VARY_FILE = "vary.json"
VARYING = "Sweeping"
SCHEMA_VERSION = 2
_MOST_STEPS = 50
_SLOWNESS = (1.0, 2.0, 4.0, 8.0)
"""Durations of the sweeps of a nonlinear model over that of the first, which is as slow as the thesis's."""
_SETTLED = 0.01
"""Change of a response from one sweep to the next, relative to its largest magnitude, below which no longer one is simulated: a
line in a figure is as wide."""


@dataclass(frozen=True, eq=False)
class Variant:
    """The model with one value of one parameter."""

    value: float  # the parameter's value
    response: FrequencyResponse | None  # frequency response, None where the model cannot be simulated with it
    # Largest error of the response relative to its largest magnitude: 0 for a linear model, whose response is
    # computed from its equations, otherwise how much it changes with a sweep of half the duration. None
    # without a response.
    error: float | None
    # ``lowest_gain`` (the magnitude at the lowest frequency), ``peak_omega``, ``peak_magnitude``,
    # ``break_frequency``, ``fitted_break_frequency``; None where the band does not show one.
    features: dict[str, float | None]
    note: str  # a remark; empty if there is none


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
    """Return frequency responses with several values of each parameter, all others unchanged.

    Those of a linear model are exact, delays included. Others are read from simulated sweeps, each twice as long as the one
    before, until the response stays.
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
    sweeps = _Sweeps(read, pair, amplitude, band)
    prepare_kernels([read.structure], 1, listener)
    stage = Stage(VARYING, sum(len(values) for values in tries), listener)
    variations = []
    for parameter, values in zip(chosen, tries, strict=True):
        variants = []
        for value in values:
            variants.append(_variant(parameter, value, sweeps))
            stage.finished(f"{parameter.name} = {value:.4g}")
        if all(variant.response is None for variant in variants):
            raise InputError(
                f"No value of '{parameter.name}' can be simulated. {variants[0].note} Try other values with --from and --to."
            )
        variations.append(Variation(parameter, read.values[parameter.name], tuple(variants)))
    if out is not None:
        _write(Path(out), str(model), variations, sweeps)
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
    if any(variant.error for variant in variation.variants):
        errors = [None if v.error is None else f"{100.0 * v.error:.1g}" for v in variation.variants]
        for row, cell in zip(rows, ["error [% of the peak]", *errors], strict=True):
            row.append(cell or "-")
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
        reported = ", ".join(
            f"{option} {end:g}{' (the default)' if value is None else ''}"
            for option, value, end in (("--from", low, first), ("--to", high, last))
        )
        raise InputError(
            f"The values of '{name}' do not increase: {reported}. Give --from and --to, the smaller value first."
        )
    if low is None and high is None and first * last > 0.0:
        values = np.geomspace(abs(first), abs(last), steps) * math.copysign(1.0, first)
    else:
        values = np.linspace(first, last, steps)
    # Exact ends, because rounding must not move a value over its bound.
    values[0], values[-1] = first, last
    return [float(value) for value in values]


@dataclass(frozen=True, eq=False)
class _Sweeps:
    """The sweeps of a model, which begin with one as slow as the thesis's."""

    model: Model
    pair: Pair
    amplitude: float
    band: tuple[float, float] | None
    made: dict[float, tuple[Record, SpectralRatio]] = field(default_factory=dict)

    def at(self, slowness: float = 1.0) -> tuple[Record, SpectralRatio]:
        """Return the sweep of this duration over the first one's, and the estimator."""
        if slowness not in self.made:
            self.made[slowness] = variation_sweep(self.model, self.pair, self.amplitude, self.band, slowness)
        return self.made[slowness]

    def response(self, changed: Mapping[str, float]) -> tuple[FrequencyResponse, float, float]:
        """Return the response, its relative error, and the part of its delay [s] that only shifts the record."""
        structure, own = without_vanished_effects(self.model.structure, {**self.model.values, **changed})
        late, prompt = self._shifts(structure, own)
        structure, own = without_vanished_effects(structure, prompt)
        omega = self.at()[1].omega
        delay = np.exp(-1j * omega * late)
        if is_linear(structure, own):
            linear = linearize(structure, own)
            if linear.is_unstable:
                raise SimulationError("The model is unstable, so that it has no frequency response.")
            row, column = linear.outputs.index(self.pair.response), linear.inputs.index(self.pair.source)
            exact = linear.frequency_response(omega)[:, row, column] * delay
            ends = self.pair.source, self.pair.response
            unit = pair_unit(self.at()[0], *ends)
            return FrequencyResponse(omega, exact, *ends, unit, method="linear equations"), 0.0, late
        before: FrequencyResponse | None = None
        for slowness in _SLOWNESS:
            record, ratio = self.at(slowness)
            simulated = simulate(structure, own, record)
            output = simulated[self.pair.response]
            # The static equilibrium is not part of the response to the sweep.
            found = ratio(simulated.with_signals(**{self.pair.response: output - output[0]}))
            largest = float(np.max(found.magnitude))
            error = math.inf
            if before is not None and largest > 0.0:
                error = float(np.max(np.abs(found.values - before.values))) / largest
            before = found
            if error <= _SETTLED or largest == 0.0:
                break
        return replace(found, values=found.values * delay), 0.0 if largest == 0.0 else error, late

    def _shifts(self, structure: Structure, values: Mapping[str, float]) -> tuple[float, dict[str, float]]:
        """Return the delay [s] of the only input and of the reading, which only shift the record, and the values without them."""
        place = [signal.name for signal in structure.rig.outputs].index(self.pair.response)
        delays = [delay for delay in (structure.delay, structure.shown_late[place]) if delay is not None]
        names = dict(zip(structure.parameter_symbols, structure.names, strict=True))
        shifting = {names[symbol] for delay in delays for symbol in delay.free_symbols}
        known = {symbol: values[name] for symbol, name in names.items() if name in shifting}
        late = float(sum(delay.xreplace(known) for delay in delays))
        return late, {**values, **dict.fromkeys(shifting, 0.0)}


def _variant(parameter: Parameter, value: float, sweeps: _Sweeps) -> Variant:
    try:
        response, error, late = sweeps.response({parameter.name: value})
    except SimulationError as problem:
        return Variant(value, None, None, {}, str(problem))
    if not np.any(response.values):
        still = f"The sweep does not move '{response.response}'; give a larger amplitude with --amplitude."
        none = ("peak_omega", "peak_magnitude", "break_frequency", "fitted_break_frequency")
        return Variant(value, response, error, {"lowest_gain": 0.0, **dict.fromkeys(none)}, still)
    top = peak(response)
    notes = [] if top.is_resonance else ["The magnitude has no peak inside the band."]
    if error > _SETTLED:
        notes.append(
            f"The response still changes by {100.0 * error:.2g} % of its peak with the duration of the sweep."
        )
    features: dict[str, float | None] = {
        "lowest_gain": float(response.magnitude[0]),
        "peak_omega": top.omega if top.is_resonance else None,
        "peak_magnitude": top.magnitude if top.is_resonance else None,
    }
    # A delay of the whole record turns the phase, and breaks nothing.
    prompt = replace(response, values=response.values * np.exp(1j * response.omega * late))
    for name, read_off in (
        ("break_frequency", break_frequency),
        ("fitted_break_frequency", fitted_break_frequency),
    ):
        try:
            features[name] = read_off(prompt)
        except InputError as problem:
            features[name] = None
            notes.append(str(problem))
    return Variant(value, response, error, features, " ".join(notes))


def _write(folder: Path, name: str, variations: Sequence[Variation], sweeps: _Sweeps) -> None:
    structure, amplitude = sweeps.model.structure, sweeps.amplitude
    excitation, ratio = sweeps.at(max(sweeps.made))
    source_unit, response_unit = (structure.rig.signal_units[name] for name in (ratio.source, ratio.response))
    unit = response_unit if source_unit in ("", "1") else f"{response_unit}/{source_unit}"
    contents: dict[str, str | bytes] = {}
    pictures = {}
    for variation in variations:
        parameter = variation.parameter
        stem = "vary" if len(variations) == 1 else f"vary_{parameter.name}"
        figure = varied_responses(
            ratio.omega,
            _curves(variation),
            f"{ratio.source} \u2192 {ratio.response}",
            unit,
            f"{name} with other {parameter.name}, sweep of {amplitude:g} {source_unit}",
        )
        pictures[parameter.name] = f"{stem}.svg"
        contents |= {f"{stem}.svg": svg_text(figure, "vary"), f"{stem}.png": png_bytes(figure, dpi=150)}
    content: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "model": name,
        "rig": structure.rig.name,
        "effects": structure.effect_names,
        "source": ratio.source,
        "response": ratio.response,
        "unit": unit,
        "sweep": {
            "amplitude": amplitude,
            "duration": excitation.duration,
            "dt": excitation.dt,
            "omega_start": MARGIN[0] * float(ratio.omega[0]),
            "omega_stop": MARGIN[1] * float(ratio.omega[-1]),
        },
        "omega": ratio.omega,
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
    write_together(folder, {**contents, VARY_FILE: json_text(json_data(content))})


def _row(variant: Variant) -> dict[str, Any]:
    found = {"value": variant.value, "error": variant.error, **variant.features, "note": variant.note}
    if variant.response is None:
        return found
    return {**found, "magnitude": variant.response.magnitude, "phase": variant.response.phase}


def _curves(variation: Variation) -> list[tuple[str, NDArray[np.complex128], bool]]:
    unit = behind(variation.parameter.unit)
    return [
        (
            f"{variation.parameter.name} = {_plain(variant.value)}{unit}",
            variant.response.values,
            math.isclose(variant.value, variation.base, rel_tol=1e-9),
        )
        for variant in variation.variants
        if variant.response is not None
    ]
