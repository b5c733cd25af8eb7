"""Results of a single estimation record: responses, transfer functions, physical parameters, and undetermined parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse
from rigsight.frequency.signal_pair import TooShortError, pair_unit
from rigsight.identify.amplitude_dependence import measured_amplitude
from rigsight.identify.identification import PathIdentification, RecordIdentification
from rigsight.identify.information import POORLY_KNOWN
from rigsight.identify.linear_view import measured_responses
from rigsight.identify.transfer.conicity import estimate_conicity
from rigsight.identify.transfer.physical_parameters import (
    PhysicalEstimates,
    form_gives_parameters,
    form_of,
    parameters_of_form,
    physical_parameters,
)
from rigsight.identify.transfer.record_response import (
    Method,
    RecordResponse,
    fit_with_relative_error,
    record_response,
)
from rigsight.identify.transfer.transfer_form import Order, TransferFit
from rigsight.identify.transfer.transfer_function import MISFIT, fit_frequency_response
from rigsight.records.record import Hold, Record
from rigsight.records.signals import instrument_of, is_constant
from rigsight.rigs import Rig, Sensor

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
    # First samples of each record that alone determine its initial state in fits over time; 0: those of its window.
    starting_samples: int = 0


def identify_record(
    record: Record,
    rig: Rig,
    constants: Mapping[str, float],
    options: EstimationOptions,
    has_forms: bool = True,
) -> RecordIdentification:
    """Return the responses that one record alone shows, with their PT2 and PT1 if the equations of its rig have such forms."""
    measured_size, moved = measured_amplitude(record, rig)
    amplitude = record.amplitude if record.amplitude is not None else measured_size
    if not rig.has_one_motion:
        paths = _to_each_input(record, rig, options)
        return RecordIdentification(record, amplitude, paths, moved="" if paths else moved)
    source = rig.inputs[0].name
    if is_constant(record[source]) and record.kind != "step":
        return RecordIdentification(record, amplitude, (), moved=moved)
    reading = _Reading(record, rig, {**constants, **record.constants}, options, has_forms)
    motion, seen = reading.motion()
    paths = (motion, *(reading.to(sensor, motion) for sensor in rig.mechanism.sensors[1:]))
    unused = "" if seen is None else seen.unused_instrument
    warnings = [f"{p.source} -> {p.response}: {p.problem}" for p in paths if p.problem]
    warnings += _resolution_warning(motion, seen, record)
    warnings += [f"{motion.source} -> {motion.response}: read without the reference. {unused}"] * bool(unused)
    return RecordIdentification(
        record, amplitude, paths, resonance=_resonance(motion), warnings=tuple(warnings)
    )


def with_own_fit(
    found: RecordIdentification, rig: Rig, own: PhysicalEstimates, constants: Mapping[str, float]
) -> RecordIdentification:
    """Return the results of a record with the parameters that were fitted to it over time."""
    # A step, and an element, have the parameters of their paths from this fit, and so has every record its rest positions.
    paths = tuple(_with_parameters(path, found.record, rig, own, constants) for path in found.paths)
    offsets = None
    if any(path.physical is not None for path in paths):
        of_paths = {name for path in paths if path.physical is not None for name in path.physical.names}
        resting = rig.motion.rest + rig.motion.bias
        resting += rig.follower.displacement if rig.follower is not None else 0
        names = {symbol.name for symbol in resting.free_symbols} & set(own.names) - of_paths
        offsets = own.only(frozenset(names))
    conicity = None
    lateral = paths[1].physical if len(paths) > 1 else None
    if lateral is not None and "c_y" in lateral.names and {"r_0", "b"} <= constants.keys():
        conicity = estimate_conicity(
            lateral.values["c_y"], lateral.standard_errors["c_y"], constants["r_0"], constants["b"]
        )
    return replace(found, paths=paths, own=own, offsets=offsets, conicity=conicity)


def _with_parameters(
    path: PathIdentification,
    record: Record,
    rig: Rig,
    own: PhysicalEstimates,
    constants: Mapping[str, float],
) -> PathIdentification:
    if path.physical is not None or path.problem or not rig.has_one_motion:
        return path
    if not rig.is_driven:
        parts = rig.motion.stiffness + rig.motion.damping
        names = {symbol.name for symbol in parts.free_symbols} & {p.name for p in rig.parameters}
        return replace(path, physical=own.only(frozenset(names)))
    if record.kind != "step":
        return path
    order: Order = "pt2" if path.source == rig.inputs[0].name else "pt1"
    physical = own.only(parameters_of_form(rig, order))
    if physical is None:
        return path
    unit = pair_unit(record, path.source, path.response)
    fit = form_of(rig, order, physical, constants, (path.source, path.response, unit))
    return replace(path, physical=physical, fit=fit)


def _to_each_input(record: Record, rig: Rig, options: EstimationOptions) -> tuple[PathIdentification, ...]:
    """Return the responses of all sensors to the inputs that move in a record."""
    measured = measured_responses([record], rig, options.method, options.resolution)
    if measured is None:
        return ()
    return tuple(
        PathIdentification(
            source.name,
            response.name,
            measured=measured.found.get((source.name, response.name)),
            problem=measured.problems.get((source.name, response.name), ""),
        )
        for source in rig.inputs
        for response in rig.outputs
        if response.name in record and not is_constant(record[source.name])
    )


@dataclass(frozen=True)
class _Reading:
    """How the responses of one record of a rig of one motion are read."""

    record: Record
    rig: Rig
    constants: Mapping[str, float]
    options: EstimationOptions
    has_forms: bool

    def motion(self) -> tuple[PathIdentification, RecordResponse | None]:
        """Return the path from the input to the motion, and how its response was read."""
        signals = [signal.name for signal in (*self.rig.inputs, *self.rig.outputs)]
        first = self.rig.mechanism.sensors[0]
        return self._read(first, self.has_forms, instrument_of(self.record, signals))

    def to(self, sensor: Sensor, motion: PathIdentification) -> PathIdentification:
        """Return the path to a further sensor: from the motion if it reads what follows that, else from the input."""
        follower = self.rig.follower
        if follower is None or sensor.reads != follower.symbol:
            return self._read(sensor, has_form=False, instrument=None)[0]
        if sensor.name not in self.record:
            unknown = " and ".join(sorted(parameters_of_form(self.rig, "pt1")))
            problem = f"the record has no {sensor.name}, so {unknown} cannot be identified from it."
            return PathIdentification(motion.response, sensor.name, problem=problem)
        has_form = self.has_forms and form_gives_parameters(self.rig, "pt1")
        return self._read(sensor, has_form, None, motion)[0]

    def _read(
        self,
        sensor: Sensor,
        has_form: bool,
        instrument: str | None,
        motion: PathIdentification | None = None,
    ) -> tuple[PathIdentification, RecordResponse | None]:
        """Return the path from the input, or from the motion if that is given, and how its response was read."""
        record, drive = self.record, self.rig.inputs[0].name
        path = PathIdentification(drive if motion is None else motion.response, sensor.name)
        if record.kind == "step" or sensor.name not in record:
            return path, None
        # A measured motion has no content above the Nyquist frequency, whatever the hold of the input.
        hold: Hold = record.hold if self.rig.is_driven and motion is None else "band_limited"
        band = None
        if motion is not None and motion.measured is not None:
            # Where the motion is below its noise, the noise would act as a source.
            band = (float(motion.measured.omega[0]), float(motion.measured.omega[-1]))
        order: Order = "pt2" if motion is None else "pt1"
        method, resolution = self.options.method, self.options.resolution
        seen = None
        try:
            seen = record_response(
                record, path.source, sensor.name, order, method, resolution, hold, band,
                instrument=instrument, drive=drive, moves_freely=has_form, upper_cut=sensor.upper_cut,
            )  # fmt: skip
            path = replace(path, measured=seen.response, coherence=seen.coherence)
            if has_form:
                path = _judged(path, _fit(seen, order, self.options), self.rig, self.constants)
        except InputError as error:
            if resolution is not None and isinstance(error, TooShortError):
                raise
            path = replace(path, problem=str(error))
        return path, seen


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
    """Fit a form whose order is too low."""
    # A PT2 is fitted to the magnitude, as in the thesis (section 4.4), because other phase shifts would distort the peak.
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


def _judged(
    path: PathIdentification, fit: TransferFit, rig: Rig, constants: Mapping[str, float]
) -> PathIdentification:
    """Return the path with the fit if it can be used, otherwise with the reason why not."""
    if not fit.success:
        return replace(path, problem=fit.message)
    gain = fit.values["gain"]
    if not fit.standard_errors["gain"] < POORLY_KNOWN * abs(gain):
        # A wrong sign would be attributed to a sensor.
        return replace(path, problem=_undetermined(["the gain"], fit.misfit))
    found = physical_parameters(rig, fit, constants)
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
