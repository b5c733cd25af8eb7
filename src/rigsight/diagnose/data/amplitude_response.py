"""Does the frequency response change with the amplitude? No leaves linear causes, yes asks for a nonlinear one."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from rigsight.diagnose.data.finding import AmplitudeDependence
from rigsight.diagnose.windows import leading_output
from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse, local_rational_response
from rigsight.records.plausibility import is_constant
from rigsight.records.record import Record
from rigsight.records.reference import instrument_of
from rigsight.rigs import Rig

_DIFFERENT_AMPLITUDE = 1.2
_STANDS_OUT = 5.0
"""Standard errors by which a response must exceed zero to be compared."""
_LINE_CHANCE = 1e-3
_LINES_CHANGED = 0.15
"""Share of independent lines that must differ: variances of sweeps may be too small on some."""
_MATTERS = 0.02
"""Relative difference that counts as a change."""
_FEWEST_LINES = 8


def amplitude_dependence(rig: Rig, records: Sequence[Record]) -> AmplitudeDependence:
    """Compare the frequency responses at the lowest and the highest amplitude of one kind of record.

    Parameters
    ----------
    rig
        The rig.
    records
        All records of a campaign; steps do not take part.
    """
    if not rig.is_driven:
        return AmplitudeDependence("cannot tell", "An element has no frequency response of a driven motion.")
    if len(rig.inputs) != 1 or not records:
        return AmplitudeDependence(
            "cannot tell",
            "Only the frequency responses of a rig with one input are compared between amplitudes.",
        )
    source, response = rig.inputs[0].name, leading_output(rig, records)
    records = [record for record in records if response in record and not is_constant(record[source])]
    if not records:
        return AmplitudeDependence(
            "cannot tell",
            "Nothing drives the rig in the sound records, so that they have no frequency response.",
        )
    pair = _extremes(records, source)
    if pair is None:
        return AmplitudeDependence(
            "cannot tell",
            "The sound records have one amplitude, so they cannot tell whether the frequency response changes with it. "
            "Record another one.",
        )
    names = (pair[0].name, pair[1].name)
    try:
        low, high, by = _responses(pair, source, response, rig)
    except InputError as error:
        return AmplitudeDependence(
            "cannot tell", f"The frequency responses cannot be compared: {error}", names
        )
    omega, first, second, variance = _common(low, high)
    if omega.size < _FEWEST_LINES:
        return AmplitudeDependence(
            "cannot tell",
            f"{names[0]} and {names[1]} share too few frequencies at which the response stands out of the noise.",
            names,
        )
    size = np.maximum(np.abs(first), np.abs(second))
    relative = np.abs(second - first) / size
    freedom = 2.0 * min(low.noise_freedom, high.noise_freedom)
    chance = f_distribution.sf(np.abs(second - first) ** 2 / variance, 2.0, freedom)
    changed = (chance < _LINE_CHANCE) & (relative > _MATTERS)
    unit = rig.inputs[0].unit if rig.inputs[0].unit != "input" else ""
    span = f"{_amplitude(pair[0], source):.3g} and {_amplitude(pair[1], source):.3g} {unit}".rstrip()
    if np.mean(changed) >= _LINES_CHANGED:
        worst = int(np.argmax(np.where(changed, relative, 0.0)))
        return AmplitudeDependence(
            "yes",
            f"The frequency response {source} -> {response} changes with the amplitude{by}: between {span} by up to "
            f"{relative[worst]:.0%} of its size (at {omega[worst]:.3g} rad/s), so a nonlinear effect takes part.",
            names,
        )
    seen = float(np.median(3.0 * np.sqrt(variance) / size))
    if np.mean(chance < _LINE_CHANCE) < _LINES_CHANGED and seen > 0.1:
        return AmplitudeDependence(
            "cannot tell",
            f"Between {span} the frequency responses{by} agree within their noise, but that hides changes of {seen:.0%}.",
            names,
        )
    return AmplitudeDependence(
        "no",
        f"The frequency response {source} -> {response} does not change with the amplitude{by} between {span} "
        f"(by {float(np.median(relative)):.1%} in the median): a linear cause, or an effect too small to be seen there.",
        names,
    )


def _responses(
    pair: Sequence[Record], source: str, response: str, rig: Rig
) -> tuple[FrequencyResponse, FrequencyResponse, str]:
    """Return both responses, read in one way, and what to say of it: by the reference of a loop where both records have one."""
    own = [signal.name for signal in (*rig.inputs, *rig.outputs)]
    instruments = [instrument_of(record, own) for record in pair]
    if all(instruments):
        with suppress(InputError):
            low, high = (
                local_rational_response(r, source, response, hold=r.hold, instrument=name)
                for r, name in zip(pair, instruments, strict=True)
            )
            return low, high, f" (with the {instruments[0]} as instrument)"
    low, high = (local_rational_response(r, source, response, hold=r.hold) for r in pair)
    return low, high, ""


def _extremes(records: Sequence[Record], source: str) -> tuple[Record, Record] | None:
    """Return the records of lowest and highest amplitude, of the kind whose amplitudes differ most."""
    best: tuple[float, Record, Record] | None = None
    for kind in dict.fromkeys(record.kind for record in records if record.kind != "step"):
        own = sorted((r for r in records if r.kind == kind), key=lambda r: _amplitude(r, source))
        smallest = _amplitude(own[0], source)
        ratio = _amplitude(own[-1], source) / smallest if smallest > 0.0 else 1.0
        if ratio >= _DIFFERENT_AMPLITUDE and (best is None or ratio > best[0]):
            best = (ratio, own[0], own[-1])
    return None if best is None else (best[1], best[2])


def _amplitude(record: Record, source: str) -> float:
    """Return the amplitude as given, else that of a sine with the same RMS."""
    return record.amplitude or float(np.sqrt(2.0) * np.std(record[source]))


def _common(
    low: FrequencyResponse, high: FrequencyResponse
) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.complex128], NDArray[np.float64]]:
    """Return frequencies far enough apart to be independent, both responses there, and the variance of their difference."""
    omega = low.omega[(low.omega >= high.omega[0]) & (low.omega <= high.omega[-1])]
    parts = []
    for response in (low, high):
        assert response.variance is not None
        values = np.interp(omega, response.omega, response.values.real) + 1j * np.interp(
            omega, response.omega, response.values.imag
        )
        parts.append((values, np.interp(omega, response.omega, response.variance)))
    (first, first_variance), (second, second_variance) = parts
    clear = (np.abs(first) > _STANDS_OUT * np.sqrt(first_variance)) & (
        np.abs(second) > _STANDS_OUT * np.sqrt(second_variance)
    )
    # A local model spans as many lines as its degrees of freedom and unknowns; neighbors share data.
    width = 1 if low.noise_lines is None else low.noise_lines.shape[1]
    kept = np.flatnonzero(clear)[::width]
    return omega[kept], first[kept], second[kept], (first_variance + second_variance)[kept]
