"""Error of a simulated frequency response, with the error that noise alone would cause, and of a simulated step.

The error is the thesis's (5.1), ``sqrt(mean(|measured - simulated|^2))`` over the lines, of the magnitude [unit of the response]
and of the phase [rad]. Lines are equally spaced in frequency, so the upper decades dominate; the error in dB weights small and
large magnitudes equally.

The thesis (section 5.2.2) compares 180 to 184 s of a step of 0.6 A at 180 s, offsets before the step removed. Here: the first
four seconds from the step (or another length), each signal less its mean over up to five seconds before it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse, responses_of_inputs
from rigsight.frequency.signal_pair import among
from rigsight.identify.transfer.record_response import Method, driven_band, record_response
from rigsight.identify.transfer.transfer_form import Order
from rigsight.metrics import rms
from rigsight.records import Floats, Hold, Record
from rigsight.records.signals import is_constant, moves_beyond_noise, roughness
from rigsight.rigs import Rig

_LEAST_CLEARNESS = 10.0
"""Power over variance (10 dB) from which a measured line is compared; a fit needs more, while an error is shown with its
floor."""
_POLES: Mapping[Method, int] = {"local_rational": 2, "local_polynomial": 0}
"""Degree of the denominator that a local model of several inputs has."""
_PER_NEPER = 20.0 / math.log(10.0)
DEFAULT_SECONDS = 4.0
_BEFORE = 5.0
"""Longest stretch before the step whose mean is the offset [s]."""
_LEAST_BEFORE = 2
_JUMP = 0.5
"""Share of the largest change between samples that counts as the step."""
_CHANCE = 1e-3
"""Probability that noise alone counts as a step."""


@dataclass(frozen=True)
class SignalPath:
    """A source and the signal that responds to it."""

    # Names of the signals.
    source: str
    response: str
    order: Order  # what the response is believed to be; only the thesis's pipeline reads it
    upper_cut: float  # angular frequency beyond which lines are not compared [rad/s]
    # True if the source is an input of the rig, whose hold the record knows; False if it was measured.
    is_commanded: bool
    # All inputs of a rig with several motions, of which any may move in a record; empty where one source says
    # it all.
    inputs: tuple[str, ...] = ()
    drive: str = ""  # the input that moves the source; empty where the source is an input

    @property
    def name(self) -> str:
        """``"u -> psi"``."""
        return f"{self.source} -> {self.response}"


@dataclass(frozen=True)
class ResponseError:
    """Errors of one path."""

    magnitude: float  # RMSE of the magnitude in the unit of the response
    phase: float  # RMSE of the phase [rad]
    decibel: float  # RMS of the ratio of the magnitudes [dB]
    n_lines: int  # lines that both have


def signal_paths(rig: Rig) -> tuple[SignalPath, ...]:
    """Return the paths of a rig: input to first output, and that to each output behind it.

    On a rig of several motions they are each input to each sensor.
    """
    if not rig.has_one_motion:
        prescribing = rig.mechanism.prescribing
        inputs = tuple(signal.name for signal in rig.inputs)
        return tuple(
            SignalPath(source, sensor.name, "pt2", sensor.upper_cut, source not in prescribing, inputs)
            for source in inputs
            for sensor in rig.mechanism.sensors
        )
    source, (first, *behind) = rig.inputs[0].name, rig.mechanism.sensors
    return (
        SignalPath(source, first.name, "pt2", first.upper_cut, rig.is_driven),
        *(SignalPath(first.name, s.name, "pt1", s.upper_cut, False, drive=source) for s in behind),
    )


def measured_responses(
    record: Record, paths: tuple[SignalPath, ...], method: Method
) -> tuple[dict[str, FrequencyResponse], list[str]]:
    """Return the response of each path by its name, at the lines that stand out of their noise, and what is in the way."""
    found: dict[str, FrequencyResponse] = {}
    problems: list[str] = []
    if record.kind == "step":
        return found, problems
    if any(path.inputs for path in paths):
        return _of_inputs(record, paths, method)
    for path in paths:
        if path.response not in record:
            continue
        first = found.get(paths[0].name)
        if first is None and path is not paths[0]:
            continue
        if is_constant(record[path.source]):
            problems.append(
                f"{path.name}: '{path.source}' is constant; without excitation there is no frequency response."
            )
            continue
        band = (0.0 if first is None else float(first.omega[0]), path.upper_cut)
        if first is not None:
            band = (band[0], min(band[1], float(first.omega[-1])))
        try:
            found[path.name] = _measured(record, path, method).band(*band)
        except InputError as error:
            problems.append(f"{path.name}: {error}")
    return found, problems


def _of_inputs(
    record: Record, paths: tuple[SignalPath, ...], method: Method
) -> tuple[dict[str, FrequencyResponse], list[str]]:
    """Return the responses to each input that moves in a record."""
    found: dict[str, FrequencyResponse] = {}
    problems: list[str] = []
    moving = [path for path in paths if path.response in record and not is_constant(record[path.source])]
    if not moving:
        problems.append("no input moves in this record; without excitation there is no frequency response.")
    for path in moving:
        try:
            found[path.name] = _measured(record, path, method)
        except InputError as error:
            problems.append(f"{path.name}: {error}")
    return found, problems


def _measured(record: Record, path: SignalPath, method: Method) -> FrequencyResponse:
    """Return the response at the lines that the input drives and that stand out of their noise."""
    found = _response(record, path, method, _LEAST_CLEARNESS)
    if path.is_commanded and method != "thesis":
        # Beyond its band an input drives next to nothing: what stands out there is transient.
        found = found.band(*driven_band(record, path.source))
    if found.variance is not None:
        is_clear = found.magnitude**2 > _LEAST_CLEARNESS * found.variance
        if np.mean(is_clear) < 0.5:
            raise InputError(
                f"{np.sum(is_clear)} of {is_clear.size} lines stand out of their noise by 10 dB, too few for a comparison. "
                + (
                    f"'{path.response}' itself moves far more than its noise, so it is no linear response to '{path.source}'."
                    if moves_beyond_noise(record[path.response])
                    else "Record for longer, or excite more."
                )
            )
    return found


def simulated_response(
    simulated: Record, path: SignalPath, method: Method, measured: FrequencyResponse
) -> FrequencyResponse:
    """Return the response of a simulated record by the estimator of the measured one, at the lines of that."""
    whole = _response(simulated, path, method, 0.0, measured.omega)
    return whole.at(among(whole.omega, measured.omega), "of those measured")


def _response(
    record: Record, path: SignalPath, method: Method, least_clearness: float, wanted: Floats | None = None
) -> FrequencyResponse:
    moving = [name for name in path.inputs if not is_constant(record[name])]
    if len(moving) > 1:
        return _among_others(record, path, moving, method)
    if path.inputs:
        record = replace(record, signals={name: record[name] for name in (path.source, path.response)})
    # A measured source is smooth between its samples, whatever the input does.
    hold: Hold = record.hold if path.is_commanded else "band_limited"
    return record_response(
        record,
        path.source,
        path.response,
        path.order,
        method,
        hold=hold,
        least_clearness=least_clearness,
        clear_alone=True,
        with_coherence=False,
        wanted=wanted,
        upper_cut=path.upper_cut,
        drive=path.drive or None,
    ).response


def _among_others(
    record: Record, path: SignalPath, moving: Sequence[str], method: Method
) -> FrequencyResponse:
    """Return the response to one of several inputs that move at once, of a local model that holds all of them."""
    if method not in _POLES:
        raise InputError(
            f"'{method}' handles one input at a time, but {' and '.join(moving)} move at once; use local_rational."
        )
    smooth = () if path.is_commanded else (path.source,)
    reported = responses_of_inputs([record], moving, [path.response], poles=_POLES[method], smooth=smooth)
    key = (path.source, path.response)
    if key not in reported.found:
        raise InputError(reported.problems[key])
    return reported.found[key]


def response_error(measured: FrequencyResponse, simulated: FrequencyResponse) -> ResponseError:
    """Return the errors over the lines that both have.

    The phases of the thesis's method are compared as they are, unwrapped and rescaled; those of other methods by the
    shorter way round, so that a turn that noise made does not count.
    """
    one = measured.at(among(measured.omega, simulated.omega), "in common with the simulation")
    other = simulated.at(among(simulated.omega, measured.omega), "in common with the measurement")
    rescaled = measured.method.startswith("thesis")
    phase = one.phase - other.phase if rescaled else np.angle(other.values * np.conj(one.values))
    with np.errstate(divide="ignore"):
        ratio = _PER_NEPER * np.log(other.magnitude / one.magnitude)
    return ResponseError(rms(one.magnitude - other.magnitude), rms(phase), rms(ratio), one.omega.size)


def response_floor(
    disturbed: Sequence[Record], path: SignalPath, method: Method, measured: FrequencyResponse
) -> ResponseError | None:
    """Return what noise alone makes of each error, None where the estimator cannot read a disturbed record.

    The response of the record with as much noise again is compared with the measured one. The variance that an estimator gives
    would be too high for this: in a sweep of a nonlinear rig it holds the distortion, which a model with the nonlinearity
    repeats.
    """
    try:
        errors = [
            response_error(measured, simulated_response(record, path, method, measured))
            for record in disturbed
        ]
    except InputError:
        return None
    magnitude, phase, decibel = (
        rms(np.array([getattr(error, name) for error in errors]))
        for name in ("magnitude", "phase", "decibel")
    )
    return ResponseError(magnitude, phase, decibel, min(error.n_lines for error in errors))


def without_shares(response: FrequencyResponse) -> FrequencyResponse:
    """Return a response without what ties its lines: tens of megabytes that no error or picture reads."""
    return replace(response, noise_shares=None, noise_lines=None)


@dataclass(frozen=True)
class StepWindow:
    """Where a step is compared."""

    # Samples of which the offset is the mean, and samples that are compared.
    before: slice
    inside: slice

    def moved(self, samples: Floats) -> Floats:
        """Return the samples inside less the mean before, shape (n_inside,)."""
        return np.asarray(samples[self.inside] - np.mean(samples[self.before]))

    def error(self, measured: Floats, simulated: Floats) -> float:
        """Return the RMSE of two signals of shape (n_samples,), offsets removed."""
        return rms(self.moved(measured) - self.moved(simulated))

    def floor(self, std: float) -> float:
        """Return the RMSE that white noise of this standard deviation makes, that of the removed mean included."""
        return std * math.sqrt(1.0 + 1.0 / (self.before.stop - self.before.start))


def stepping_input(record: Record, sources: Sequence[str]) -> str:
    """Return the input that steps first; the first of all where none moves."""
    moving = [name for name in sources if not is_constant(record[name])]
    jumping = [name for name in moving if _exceeds_noise(record[name])]
    return min(jumping or moving, key=lambda name: _first_jump(record[name]), default=sources[0])


def _first_jump(samples: Floats) -> int:
    """Return the first sample after the first large change; 0 for a constant."""
    change = np.abs(np.diff(samples))
    largest = float(change.max(initial=0.0))
    return int(np.argmax(change >= _JUMP * largest)) + 1 if largest > 0.0 else 0


def _exceeds_noise(samples: Floats) -> bool:
    """Return True if noise as rough as that of the samples does not explain their largest change."""
    change = np.abs(np.diff(samples))
    # The difference of two samples has twice the variance of their noise; of all changes the largest is tested, to both sides.
    limit = math.sqrt(2.0) * norm.isf(_CHANCE / (2.0 * change.size)) * roughness(samples)
    return bool(np.max(change) > limit)


def step_window(record: Record, source: str, seconds: float = DEFAULT_SECONDS) -> StepWindow:
    """Return where the first step of a record is compared."""
    start = _first_jump(record[source])
    if start == 0:
        raise InputError(
            f"Record '{record.name}': the input '{source}' is constant from the first sample, so the offset before the step is "
            "unknown. Record some time at rest before the step."
        )
    first = max(0, start - round(_BEFORE / record.dt))
    if start - first < _LEAST_BEFORE:
        raise InputError(
            f"Record '{record.name}': the step comes {start * record.dt:.3g} s after the first sample, so the offset before it "
            f"is unknown. Record some time at rest before the step."
        )
    stop = min(record.n_samples, start + round(seconds / record.dt) + 1)
    return StepWindow(slice(first, start), slice(start, stop))
