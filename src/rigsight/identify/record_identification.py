"""Results of a single estimation record: transfer functions, physical parameters, offsets, and undetermined parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse
from rigsight.frequency.signal_pair import TooShortError
from rigsight.identify.amplitude_dependence import measured_amplitude
from rigsight.identify.identification import PathIdentification, RecordIdentification
from rigsight.identify.transfer.conicity import ConicityEstimate, estimate_conicity
from rigsight.identify.transfer.driven_offsets import driven_offsets
from rigsight.identify.transfer.record_response import Method, RecordResponse, record_response
from rigsight.identify.transfer.relative_fit import fit_with_relative_error
from rigsight.identify.transfer.running_gear_parameters import (
    PhysicalEstimates,
    axis_parameters,
    lateral_parameters,
    static_lateral,
    yaw_parameters,
)
from rigsight.identify.transfer.transfer_fit import TransferFit
from rigsight.identify.transfer.transfer_form import Order
from rigsight.identify.transfer.transfer_function import MISFIT, fit_frequency_response
from rigsight.identify.transfer.transfer_step import fit_step, input_at_rest
from rigsight.identify.undetermined import POORLY_KNOWN
from rigsight.records.record import Hold, Record
from rigsight.records.signals import instrument_of
from rigsight.rigs import Rig, evaluated

_SURE = 0.1
"""Relative standard error above which a line is no evidence of a peak."""
_PEAK = 1.1
"""Height over the lowest lines from which a largest magnitude counts as a resonance."""
_LOWEST = 10
_LONGEST_DELAY = 0.5 * math.pi
"""Largest phase shift by a dead time at the largest magnitude [rad]."""
_TURNED = -0.5
"""Correlation of fitted and measured values below which the sign of one signal is reversed."""
_WELL_BELOW = 0.5
"""Share of the break frequency up to which a response follows its source, so that a delay changes the phase little."""


@dataclass(frozen=True)
class EstimationOptions:
    """Settings of the identification of records."""

    method: Method = "local_rational"  # estimator of the frequency responses
    resolution: float | None = None  # requested width [rad/s]; None takes the default of each record


def identify_record(
    record: Record, rig: Rig, constants: Mapping[str, float], options: EstimationOptions
) -> RecordIdentification:
    """Identify the rig from one record."""
    amplitude = record.amplitude if record.amplitude is not None else measured_amplitude(record, rig)[0]
    if not rig.is_driven:
        return RecordIdentification(record, amplitude, (_dynamic_stiffness(record, rig, options),))
    forward = _driven_forward(record, constants.get("gain", 1.0))
    instrument = instrument_of(record, [signal.name for signal in (*rig.inputs, *rig.outputs)])
    motion, seen = _motion(forward, rig, constants, options, instrument)
    unused = "" if seen is None else seen.unused_instrument
    paths, warnings = [motion], _resolution_warning(motion, seen, record)
    warnings += [f"{motion.source} -> {motion.response}: read without the reference. {unused}"] * bool(unused)
    if rig.downstream:
        paths.append(_lateral(record, rig, constants, options, motion))
    warnings = [*(f"{p.source} -> {p.response}: {p.problem}" for p in paths if p.problem), *warnings]
    return RecordIdentification(
        record=record,
        amplitude=amplitude,
        paths=tuple(paths),
        offsets=_offsets(forward, rig, paths),
        conicity=_conicity(paths[1:], constants),
        resonance=_resonance(motion),
        warnings=tuple(warnings),
    )


def _driven_forward(record: Record, gain: float) -> Record:
    """Reverse the input of an axis with a negative drive gain, because transfer functions need positive gains."""
    return record if gain > 0.0 else record.with_signals(u=-record["u"])


def _motion(
    record: Record,
    rig: Rig,
    constants: Mapping[str, float],
    options: EstimationOptions,
    instrument: str | None,
) -> tuple[PathIdentification, RecordResponse | None]:
    source, response = rig.inputs[0].name, rig.outputs[0].name

    def physical(fit: TransferFit) -> PhysicalEstimates:
        if rig.downstream:
            return yaw_parameters(fit, constants)
        return axis_parameters(fit, abs(evaluated(rig.motion.drive_gain, constants)))

    path = PathIdentification(source, response)
    seen = None
    try:
        if record.kind == "step":
            fit = fit_step(record, source, response, "pt2")
        else:
            seen = record_response(
                record,
                source,
                response,
                "pt2",
                options.method,
                options.resolution,
                record.hold,
                instrument=instrument,
                moves_freely=True,
            )
            path = replace(path, measured=seen.response, coherence=seen.coherence)
            fit = _fit(seen, "pt2", options)
        return _judged(path, fit, physical), seen
    except InputError as error:
        if options.resolution is not None and isinstance(error, TooShortError):
            raise
        return replace(path, problem=str(error)), seen


def _lateral(
    record: Record,
    rig: Rig,
    constants: Mapping[str, float],
    options: EstimationOptions,
    motion: PathIdentification,
) -> PathIdentification:
    path = PathIdentification("psi", "y")
    if "y" not in record:
        return replace(
            path, problem="the record has no y, so l_0, c_y and y_off cannot be identified from it."
        )
    band = None
    if motion.measured is not None:
        # Where psi is below its noise, the noise would act as a source.
        band = (float(motion.measured.omega[0]), float(motion.measured.omega[-1]))
    # psi is measured, so it has no content above the Nyquist frequency, whatever the hold of the current.
    smooth: Hold = "band_limited"
    try:
        if record.kind == "step":
            fit = fit_step(_from_rest(record, motion.fit), "psi", "y", "pt1")
        else:
            seen = record_response(
                record,
                "psi",
                "y",
                "pt1",
                options.method,
                options.resolution,
                smooth,
                band,
                drive=rig.inputs[0].name,
                moves_freely=True,
            )
            path = replace(path, measured=seen.response, coherence=seen.coherence)
            fit = _fit(seen, "pt1", options)
        return _judged(path, fit, lambda found: lateral_parameters(found, constants))
    except InputError as error:
        return replace(path, problem=str(error))


def _dynamic_stiffness(record: Record, rig: Rig, options: EstimationOptions) -> PathIdentification:
    path = PathIdentification(rig.inputs[0].name, rig.outputs[0].name)
    if record.kind == "step":
        return path
    try:
        seen = record_response(
            record, path.source, path.response, "pt2", options.method, options.resolution, "band_limited"
        )
    except InputError as error:
        if options.resolution is not None and isinstance(error, TooShortError):
            raise
        return replace(path, problem=str(error))
    return replace(path, measured=seen.response, coherence=seen.coherence)


def _fit(seen: RecordResponse, order: Order, options: EstimationOptions) -> TransferFit:
    """Fit with standard errors that count independent values, not lines."""
    # The thesis fits magnitudes only (section 4.4), because its phases are rescaled.
    by_magnitude = options.method == "thesis"
    response, plain = seen.response, seen.plain
    fitted = plain or response
    fit = seen.fit or fit_frequency_response(fitted, order, magnitude_only=by_magnitude)
    factor = 1.0 if plain is not None or response.noise_shares is not None else seen.lines_per_value
    if fit.misfit > MISFIT and order == "pt2" and not by_magnitude:
        longest = _LONGEST_DELAY / float(response.omega[np.argmax(response.magnitude)])
        late = fit_frequency_response(fitted, order, longest_dead_time=longest)
        if late.misfit <= MISFIT:
            note = f"A dead time of {1e3 * late.values['dead_time']:.3g} ms was needed."
            fit = replace(late, message=f"{late.message} {note}")
    if fit.misfit > MISFIT:
        fit, factor = _fit_of_part(response, order, fit.misfit), seen.lines_per_value
    errors = {name: math.sqrt(factor) * error for name, error in fit.standard_errors.items()}
    return replace(fit, standard_errors=errors, covariance=factor * fit.covariance)


def _fit_of_part(response: FrequencyResponse, order: Order, misfit: float) -> TransferFit:
    """Fit a form whose order is too low.

    A PT2 is fitted to the magnitude, as in the thesis (section 4.4), because other phase shifts would distort the peak.
    """
    fit, share = fit_with_relative_error(response, order, magnitude_only=order == "pt2")
    read = " The fit uses magnitudes only." if order == "pt2" else ""
    note = (
        f"The residuals are {misfit:.0f} times larger than the noise explains: the model order is too low.{read} An error of "
        f"{100.0 * share:.0f} % of the magnitude was assumed at every line."
    )
    return replace(fit, values=_with_sign(fit, response), misfit=misfit, message=f"{fit.message} {note}")


def _with_sign(fit: TransferFit, response: FrequencyResponse) -> dict[str, float]:
    """Return the values of a fit, with a negative gain if the phases show that the response is opposite to the source."""
    break_frequency = fit.values["omega_b"]

    def agreement(lines: NDArray[np.bool_]) -> float:
        fitted, measured = fit.at(response.omega[lines]), response.values[lines]
        size = float(np.linalg.norm(fitted) * np.linalg.norm(measured))
        return float(np.vdot(fitted, measured).real) / size if size > 0.0 else 0.0

    if agreement(response.omega < _WELL_BELOW * break_frequency) >= _TURNED:
        return fit.values
    fast = response.omega > break_frequency / _WELL_BELOW
    if fit.form.order == "pt2" and not np.any(fast):
        raise InputError(
            "the response is opposite to the input at low frequencies, and no line is far enough above the break to tell "
            "a negative stiffness from a signal of the wrong sign. Check both, or record over a wider band."
        )
    if fit.form.order == "pt2" and agreement(fast) > -_TURNED:
        raise InputError(
            "the response is opposite to the input at low frequencies and not at high ones, so no signal has the wrong sign: the "
            "stiffness is negative, and the rig is unstable without its control loop. Use a rig whose stiffness may be negative, "
            "such as the axis or a rig file with a lower bound below 0: its records are fitted in short windows."
        )
    return {**fit.values, "gain": -fit.values["gain"]}


def _from_rest(record: Record, motion: TransferFit | None) -> Record:
    """Set the first sample of psi to the rest position of the fit; its noise would count as a step of the source."""
    record = replace(record, hold="foh")
    if motion is None:
        return record
    psi = record["psi"].copy()
    psi[0] = motion.values["offset"]
    return record.with_signals(psi=psi)


def _judged(
    path: PathIdentification, fit: TransferFit, physical: Callable[[TransferFit], PhysicalEstimates]
) -> PathIdentification:
    """Return the path with the fit if it can be used, otherwise with the reason why not."""
    if not fit.success:
        return replace(path, problem=fit.message)
    gain = fit.values["gain"]
    if not fit.standard_errors["gain"] < POORLY_KNOWN * abs(gain):
        # A wrong sign would be attributed to a sensor.
        return replace(path, problem=_undetermined(["the gain"], fit.misfit))
    found = physical(fit)
    errors = found.standard_errors
    poor = [name for name in found.names if not errors[name] < POORLY_KNOWN * abs(found.values[name])]
    if len(poor) > 1 or (poor and fit.form.order == "pt1"):
        # A damping near zero is a valid result; the other parameters must be positive.
        return replace(path, problem=_undetermined(poor, fit.misfit))
    return replace(path, fit=fit, physical=found)


def _undetermined(names: list[str], misfit: float) -> str:
    lacking = f"the record does not determine {', '.join(names)}"
    if misfit > MISFIT:
        # More data reduce noise, but not what the equations lack.
        return (
            f"{lacking}: the response is not that of these equations, its residuals are {misfit:.3g} times the noise. "
            f"A longer or stronger record does not help. Check the signals (wrapped, held, another unit or column); "
            f"'rigsight diagnose' finds missing effects."
        )
    return (
        f"{lacking}: it is too short, or its input does not excite the frequencies around the break. Record for longer, over a "
        f"wider band, or at a larger amplitude."
    )


def _resolution_warning(motion: PathIdentification, seen: RecordResponse | None, record: Record) -> list[str]:
    if motion.fit is None or seen is None or "zeta" not in motion.fit.values:
        return []
    if seen.plain is not None and motion.fit.misfit <= MISFIT:
        # Fitted to all lines together, without local bands.
        return []
    omega_0, zeta = motion.fit.values["omega_b"], motion.fit.values["zeta"]
    width = 2.0 * zeta * omega_0
    if zeta >= 0.5 or width >= seen.narrowest:
        return []
    longer = record.n_samples * record.dt * seen.narrowest / width
    return [
        f"{motion.source} -> {motion.response}: the peak at {omega_0:.3g} rad/s is {width:.2g} rad/s wide (half power), but this "
        f"record resolves only peaks of at least {seen.narrowest:.2g} rad/s. Damping and height of the peak are unreliable; "
        f"record at least "
        f"{longer:.3g} s."
    ]


def _offsets(record: Record, rig: Rig, paths: list[PathIdentification]) -> PhysicalEstimates | None:
    motion = paths[0]
    if motion.fit is None:
        return None
    lateral = paths[1] if len(paths) > 1 and paths[1].physical is not None else None
    rest = next(symbol.name for symbol in rig.motion.rest.free_symbols)
    if record.kind == "step":
        return _step_offsets(record, rest, motion.fit, lateral)
    return driven_offsets(record, motion.fit, None if lateral is None else lateral.fit, rest)


def _step_offsets(
    record: Record, rest: str, fit: TransferFit, lateral: PathIdentification | None
) -> PhysicalEstimates:
    """Return the offsets of a step from the responses at rest before it, by (2.26) and (2.27)."""
    first = input_at_rest(record, fit.source)
    at_rest = fit.values["offset"]
    slope = np.array([1.0, -first])
    variance = float(slope @ fit.covariance_of("offset", "gain") @ slope)
    names, values, covariance = [rest], {rest: at_rest - first * fit.values["gain"]}, np.array([[variance]])
    if lateral is not None and lateral.fit is not None and lateral.physical is not None:
        l_0, l_0_error = lateral.physical.values["l_0"], lateral.physical.standard_errors["l_0"]
        names.append("y_off")
        per_radian, per_length = static_lateral(l_0)
        values["y_off"] = lateral.fit.values["offset"] - per_radian * at_rest
        own = fit.standard_errors["offset"]
        error = math.hypot(
            lateral.fit.standard_errors["offset"], per_radian * own, per_length * at_rest * l_0_error
        )
        shared = -per_radian * own**2
        covariance = np.array([[variance, shared], [shared, error**2]])
    return PhysicalEstimates(tuple(names), values, covariance, "rest before the step, (2.26) and (2.27)")


def _conicity(lateral: list[PathIdentification], constants: Mapping[str, float]) -> ConicityEstimate | None:
    if not lateral or lateral[0].physical is None:
        return None
    found = lateral[0].physical
    return estimate_conicity(
        found.values["c_y"], found.standard_errors["c_y"], constants["r_0"], constants["b"]
    )


def _resonance(motion: PathIdentification) -> float | None:
    """Return the frequency at which the measured magnitude is largest, if that is a peak."""
    measured = motion.measured
    if measured is None:
        return None
    sure = np.ones(measured.omega.size, dtype=np.bool_)
    if measured.variance is not None:
        sure = np.sqrt(measured.variance) < _SURE * measured.magnitude
    if np.count_nonzero(sure) < 2 * _LOWEST:
        return None
    seen = measured.at(sure)
    top = int(np.argmax(seen.magnitude))
    if top in (0, seen.omega.size - 1) or seen.magnitude[top] < _PEAK * np.median(seen.magnitude[:_LOWEST]):
        return None
    return float(seen.omega[top])
