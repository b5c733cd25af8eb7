"""Does the frequency response change with the amplitude? If not, the cause is linear; if so, nonlinear."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from rigsight.diagnose.data_quality.finding import AmplitudeDependence, Answer
from rigsight.diagnose.policy import NOTES
from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse, local_rational_response, responses_of_inputs
from rigsight.identify.fit.windows import leading_output
from rigsight.records.record import Floats, Record
from rigsight.records.signals import instrument_of, is_constant
from rigsight.rigs import Rig


def amplitude_dependences(
    rig: Rig, records: Sequence[Record], faulty: Collection[tuple[str, str]] = ()
) -> tuple[AmplitudeDependence, ...]:
    """Compare the frequency responses at the lowest and the highest amplitude of one kind of record, path by path."""
    # On a rig with one motion the path from its input to its motion is compared, on any other those from each input to each
    # sensor.
    if not rig.is_driven:
        return (
            AmplitudeDependence(
                "cannot tell", "A single element has no driven motion and so no frequency response."
            ),
        )
    if not rig.inputs or not records:
        return (AmplitudeDependence("cannot tell", "The rig has no input and so no frequency response."),)
    if rig.has_one_motion:
        responses = [leading_output(rig, records)]
    else:
        responses = [signal.name for signal in rig.outputs if any(signal.name in r for r in records)]
    return tuple(
        _of_path(rig, [r for r in records if (r.name, response) not in faulty], source.name, response)
        for source in rig.inputs
        for response in responses
    )


def _of_path(rig: Rig, records: Sequence[Record], source: str, response: str) -> AmplitudeDependence:
    records = [record for record in records if response in record and not is_constant(record[source])]
    path, alone = f"{source} -> {response}", len(rig.inputs) == 1
    pair = _extremes(records, source, alone)
    if pair is not None:
        answer, sentence = _between(pair, source, response, rig)
        return AmplitudeDependence(answer, sentence, (pair[0].name, pair[1].name), path)
    heights = {f"{_amplitude(r, source, alone):.2g}" for r in records if r.kind == "step"}
    if not records:
        why = f"'{source}' changes in no record in which '{response}' can be used, so there is no frequency response {path}."
    elif len(heights) > 1:
        why = (
            f"There are steps of {len(heights)} heights, but no frequency response is found from steps, and the other usable "
            f"records do not have two amplitudes{'' if alone else f' of {source}'}. Only frequency responses {path} are "
            f"compared here; record a sweep or a multisine at two amplitudes for that."
        )
    else:
        why = (
            f"The usable records have only one amplitude{'' if alone else f' of {source}'}, so they cannot tell whether the "
            f"frequency response {path} changes with it. Record another amplitude."
        )
    return AmplitudeDependence("cannot tell", why, path=path)


def _between(pair: tuple[Record, Record], source: str, response: str, rig: Rig) -> tuple[Answer, str]:
    """Return whether the response differs between two records of other amplitudes, and the answer with numbers."""
    path, alone = f"{source} -> {response}", len(rig.inputs) == 1
    try:
        low, high, by = _responses(pair, source, response, rig)
    except InputError as error:
        return "cannot tell", f"The frequency responses {path} cannot be compared: {error}"
    omega, first, second, variance = _common(low, high)
    if omega.size < NOTES.fewest_lines:
        return "cannot tell", (
            f"{pair[0].name} and {pair[1].name} have too few common frequencies at which the response {path} stands out of the "
            "noise."
        )
    size = np.maximum(np.abs(first), np.abs(second))
    relative = np.abs(second - first) / size
    freedom = 2.0 * min(low.noise_freedom, high.noise_freedom)
    chance = f_distribution.sf(np.abs(second - first) ** 2 / variance, 2.0, freedom)
    changed = (chance < NOTES.line_chance) & (relative > NOTES.response_change)
    unit = next(signal.unit for signal in rig.inputs if signal.name == source)
    lowest, highest = (_amplitude(record, source, alone) for record in pair)
    span = f"{lowest:.3g} and {highest:.3g} {'' if unit == 'input' else unit}".rstrip()
    if np.mean(changed) >= NOTES.lines_changed:
        worst = int(np.argmax(np.where(changed, relative, 0.0)))
        return "yes", (
            f"The frequency response {path} changes with the amplitude{by}: between {span} by up to "
            f"{relative[worst]:.0%} of its size (at {omega[worst]:.3g} rad/s), so a nonlinear effect is involved."
        )
    seen = float(np.median(3.0 * np.sqrt(variance) / size))
    if np.mean(chance < NOTES.line_chance) < NOTES.lines_changed and seen > 0.1:
        return "cannot tell", (
            f"Between {span} the frequency responses {path}{by} agree within their noise, but the noise would hide changes up to "
            f"{seen:.0%}."
        )
    return "no", (
        f"The frequency response {path} does not change with the amplitude{by} between {span} "
        f"(by {float(np.median(relative)):.1%} in the median): the cause is linear, or too small to show here."
    )


def _responses(
    pair: Sequence[Record], source: str, response: str, rig: Rig
) -> tuple[FrequencyResponse, FrequencyResponse, str]:
    """Return both responses, read in one way, and what to say of it: by the reference of a loop where both records have one."""
    own = [signal.name for signal in (*rig.inputs, *rig.outputs)]
    instruments = [instrument_of(record, own) for record in pair]
    if len(rig.inputs) == 1 and all(instruments):
        with suppress(InputError):
            low, high = (
                local_rational_response(r, source, response, hold=r.hold, instrument=name)
                for r, name in zip(pair, instruments, strict=True)
            )
            return low, high, f" (with the {instruments[0]} as instrument)"
    low, high = (_response(r, source, response, rig) for r in pair)
    return low, high, ""


def _response(record: Record, source: str, response: str, rig: Rig) -> FrequencyResponse:
    """Return the response to one input, beside the others that move in the same record."""
    prescribing = sorted(rig.mechanism.prescribing)
    moving = [signal.name for signal in rig.inputs if not is_constant(record[signal.name])]
    if len(moving) == 1:
        # A measured motion is smooth between its samples.
        hold = "band_limited" if source in prescribing else record.hold
        return local_rational_response(record, source, response, hold=hold)
    reported = responses_of_inputs([record], moving, [response], smooth=prescribing)
    if (source, response) not in reported.found:
        raise InputError(f"{record.name}: {reported.problems[source, response]}")
    return reported.found[source, response]


def _extremes(records: Sequence[Record], source: str, alone: bool) -> tuple[Record, Record] | None:
    """Return the records of lowest and highest amplitude, of the kind whose amplitudes differ most."""
    best: tuple[float, Record, Record] | None = None
    for kind in dict.fromkeys(record.kind for record in records if record.kind != "step"):
        own = sorted((r for r in records if r.kind == kind), key=lambda r: _amplitude(r, source, alone))
        smallest = _amplitude(own[0], source, alone)
        ratio = _amplitude(own[-1], source, alone) / smallest if smallest > 0.0 else 1.0
        if ratio >= NOTES.another_amplitude and (best is None or ratio > best[0]):
            best = (ratio, own[0], own[-1])
    return None if best is None else (best[1], best[2])


def _amplitude(record: Record, source: str, alone: bool) -> float:
    """Return the amplitude as given for the only input, else half the range, as everywhere."""
    return (alone and record.amplitude) or 0.5 * float(np.ptp(record[source]))


def _common(
    low: FrequencyResponse, high: FrequencyResponse
) -> tuple[Floats, NDArray[np.complex128], NDArray[np.complex128], Floats]:
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
    clear = (np.abs(first) > NOTES.clearly * np.sqrt(first_variance)) & (
        np.abs(second) > NOTES.clearly * np.sqrt(second_variance)
    )
    # A local model spans as many lines as its degrees of freedom and unknowns; neighbors share data.
    width = 1 if low.noise_lines is None else low.noise_lines.shape[1]
    kept = np.flatnonzero(clear)[::width]
    kept = _apart(kept, omega, max(low.shared_width, high.shared_width))
    return omega[kept], first[kept], second[kept], (first_variance + second_variance)[kept]


def _apart(indices: NDArray[np.intp], omega: Floats, width: float) -> NDArray[np.intp]:
    """Return those indices, from the first on, whose frequencies lie at least a width apart."""
    kept: list[int] = []
    for index in indices:
        if not kept or omega[index] - omega[kept[-1]] >= width:
            kept.append(int(index))
    return np.array(kept, dtype=np.intp)
