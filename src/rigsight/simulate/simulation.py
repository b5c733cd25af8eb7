"""Accurate simulation of one parameter set of a structure for a record's input."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError, SimulationError, check_option
from rigsight.records.record import Floats, Record
from rigsight.simulate.compiled.kernel import kernel_of
from rigsight.simulate.equations.composition import without_vanished_effects
from rigsight.simulate.equations.structure import Structure, ahead_name, bandwidth_name
from rigsight.simulate.equilibrium import rest_state
from rigsight.simulate.input_hold import HeldInput, hold_accelerated_motion, hold_input, hold_motion, together
from rigsight.simulate.model import at_parameters
from rigsight.simulate.prescribed_motion import accelerated_motion, smooth_motion

DEFAULT_ACCURACY = 1e-6
"""Relative RMS error of the first output that `simulate` aims for."""
LOCAL_PER_GLOBAL = 0.03
"""Error allowed per step for one unit of global error; measured on 122 rigs of the blind bench and on the sets of the thesis.

Ten times as much saves a tenth of the time, but the error is then five times the requested one if dry friction sticks and slips
in a wide sweep.
"""

_REASONS = {
    1: "more than 20000 steps were needed within one sample; the model is too stiff or chatters",
    2: "the motion diverged; the model is unstable with these parameters",
    3: "not enough memory for the history of its delays",
}


def record_input(structure: Structure, record: Record) -> HeldInput:
    """Return the input of a record between its samples, with the record's hold.

    A prescribed motion is the smoothing spline through the measured displacement.
    """
    mechanism = structure.rig.mechanism
    if not structure.n_inputs:
        # A rig without inputs still needs the division of time into pieces.
        return hold_input(np.zeros(record.n_samples), record.dt, "zoh")

    def held(index: int, name: str) -> HeldInput:
        if name not in mechanism.prescribing:
            return hold_input(record[name], record.dt, record.hold)
        if index in structure.accelerating_inputs:
            return hold_accelerated_motion(*accelerated_motion(record[name], record.dt), record.dt)
        return hold_motion(*smooth_motion(record[name], record.dt), record.dt)

    def observed(sensor: str) -> HeldInput:
        if sensor not in record:
            return hold_input(np.zeros(record.n_samples), record.dt, "foh")
        return hold_motion(*smooth_motion(record[sensor], record.dt), record.dt)

    return together(
        [*(held(*each) for each in enumerate(mechanism.inputs)), *map(observed, structure.observed)]
    )


def simulate(
    structure: Structure,
    values: Mapping[str, float],
    record: Record,
    initial_state: Floats | None = None,
    accuracy: float = DEFAULT_ACCURACY,
    before: Floats | Mapping[str, Floats] | None = None,
) -> Record:
    """Simulate a record's input and return the outputs as a record of the same form.

    Parameters
    ----------
    structure
        Rig and effects.
    values
        Value of each of the structure's parameters, by name.
    record
        Input samples, hold and constants of the record; its outputs are not used.
    initial_state
        Shape (n_states,), in the order of ``structure.states``; default is the static equilibrium at the first input sample.
    accuracy
        Relative RMS error to aim for.
    before
        Input samples (or the prescribed displacement) just before the record at its sample time, which set the memory of
        hysteresis, friction and delays. Shape (n_before, n_inputs) in the order of the rig's inputs, (n_before,) for a rig with
        one input, or the samples of each input by its name. The initial state is then that at the first of them.

    Raises
    ------
    InputError
        If `before` does not contain samples of each of the rig's inputs.
    SimulationError
        If the motion diverges or the model is too stiff.
    """
    if before is not None:
        earlier = _before(structure, before)
        n_before = next(iter(earlier.values())).size
        if n_before == 0:
            return simulate(structure, values, record, initial_state, accuracy)
        signals = {name: np.concatenate([samples, record[name]]) for name, samples in earlier.items()}
        longer = replace(record, signals=signals, t0=record.t0 - n_before * record.dt)
        whole = simulate(structure, values, longer, initial_state, accuracy)
        names = [signal.name for signal in structure.rig.outputs]
        return record.with_signals(**{name: whole[name][n_before:] for name in names})
    complete = structure
    structure, values = without_vanished_effects(complete, record_values(complete, values, record))
    held = record_input(structure, record)
    p = parameter_vector(structure, values)
    if initial_state is None:
        initial_state = rest_state(structure, p, held)
    elif structure is not complete:
        initial_state = np.asarray(initial_state)[
            [complete.states.index(state) for state in structure.states]
        ]
    outputs = simulate_outputs(structure, held, p, initial_state, record.n_samples, accuracy)
    names = [signal.name for signal in structure.rig.outputs]
    return record.with_signals(**{name: outputs[:, i] for i, name in enumerate(names)})


def _before(structure: Structure, before: Floats | Mapping[str, Floats]) -> dict[str, Floats]:
    """Return the samples of each input before the record, by its name."""
    inputs = [signal.name for signal in structure.rig.inputs]
    if not inputs:
        raise InputError(
            f"'before' contains samples of inputs, but {structure.rig.name} has none. Give its initial state instead."
        )
    wanted = f"{structure.rig.name} has the inputs {', '.join(inputs)}"
    if isinstance(before, Mapping):
        if set(before) != set(inputs):
            raise InputError(f"'before' has samples of {', '.join(before) or 'nothing'}; {wanted}.")
        columns = [np.asarray(before[name], dtype=np.float64) for name in inputs]
    else:
        samples = np.asarray(before, dtype=np.float64)
        columns = list((samples[:, None] if samples.ndim == 1 else samples).T)
    shapes = {column.shape for column in columns}
    if len(columns) != len(inputs) or len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise InputError(
            f"'before' has the shape {np.shape(before) if not isinstance(before, Mapping) else sorted(shapes)}; {wanted}: "
            f"give (n_before, {len(inputs)}) samples, or as many of each by its name."
        )
    return dict(zip(inputs, columns, strict=True))


def record_values(structure: Structure, values: Mapping[str, float], record: Record) -> dict[str, float]:
    """Return values with a record's own constants in place of the common ones, and with the bandwidths of its observer.

    Raises
    ------
    InputError
        If the rig has no such constant.
    """
    known = [constant.name for constant in structure.rig.constants]
    for name in record.constants:
        check_option(f"Record '{record.name}': constant", name, known)
    bandwidths = {bandwidth_name(sensor): record.observed.get(sensor, 0.0) for sensor in structure.observed}
    return {**values, **record.constants, **bandwidths}


def parameter_vector(structure: Structure, values: Mapping[str, float]) -> Floats:
    """Return the parameter values in the order of the structure, shape (n_parameters,).

    A missing value is the parameter's default; values of other names are ignored.

    Raises
    ------
    InputError
        If a value without a default is missing; the message lists all of them.
    """
    known = {p.name: values.get(p.name, p.default) for p in structure.parameters}
    missing = [name for name, value in known.items() if value is None]
    if missing:
        raise InputError(
            f"Missing parameters: {', '.join(missing)}. The model has: {', '.join(structure.names)}."
        )
    return np.array(list(known.values()), dtype=np.float64)


def simulate_outputs(
    structure: Structure,
    held: HeldInput,
    p: Floats,
    initial_state: Floats,
    n_samples: int,
    accuracy: float = DEFAULT_ACCURACY,
    taken: NDArray[np.intc] | None = None,
) -> Floats:
    """Return the outputs of one parameter set, shape (n_samples, n_outputs).

    If `taken` is given, shape (n_pieces,), the number of steps in each piece of the input is written to it.

    Raises
    ------
    SimulationError
        If the motion diverges or the model is too stiff.
    """
    held, p = read_ahead(structure, held, p)
    status, out, _ = kernel_of(structure).simulate_one(
        held, p, state_vector(structure, initial_state), LOCAL_PER_GLOBAL * accuracy, n_samples, taken
    )
    if status != 0:
        effects = ", ".join(structure.effect_names) or "no effect"
        raise SimulationError(f"Simulation of {structure.rig.name} with {effects}: {_REASONS[status]}.")
    return as_measured(structure, p[:, None], out[:, :, None], held)[:, :, 0]


def state_vector(structure: Structure, state: Floats) -> Floats:
    """Return the initial states in the form that a kernel takes."""
    return np.asarray(state, dtype=np.float64)[: max(1, len(structure.states))]


def as_measured(structure: Structure, p: Floats, out: Floats, held: HeldInput) -> Floats:
    """Shift outputs by the delays of their sensors; beyond its ends the record is continued with its rates there."""
    if not structure.is_shifted:
        return out
    n_samples = out.shape[0]
    visible = out[:, : len(structure.outputs)].copy()
    if n_samples < 2:
        return visible
    dt = held.interval * held.per_sample
    late = [(i, delay) for i, delay in enumerate(structure.shown_late) if delay is not None]
    for column, (output, delay) in enumerate(late, len(structure.outputs)):
        values = at_parameters(structure, delay, p)
        delays, rise = np.broadcast_to(values, p.shape[1]) / dt, out[:, column] * dt
        for i, own in enumerate(delays):
            visible[:, output, i] = _delayed(out[:, output, i].copy(), rise[:, i].copy(), float(own))
    return visible


def _delayed(value: Floats, rise: Floats, delay: float) -> Floats:
    """Return values, shape (n_samples,), delayed by a number of samples; `rise` is their slope per sample."""
    if not np.isfinite(delay):
        return np.full_like(value, np.nan)
    n_samples = value.size
    whole = int(np.clip(np.ceil(delay), -n_samples, n_samples))
    # A delay is the same fraction of every interval, so the Hermite polynomials are four numbers.
    s = whole - delay
    begin, end = max(whole, 0), min(n_samples, max(n_samples - 1 + whole, 0))
    left, right = slice(begin - whole, end - whole), slice(begin - whole + 1, end - whole + 1)
    delayed = np.empty_like(value)
    # The values of a set that diverges may overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        delayed[begin:end] = (
            (1.0 + 2.0 * s) * (1.0 - s) ** 2 * value[left]
            + s**2 * (3.0 - 2.0 * s) * value[right]
            + s * (1.0 - s) ** 2 * rise[left]
            - s**2 * (1.0 - s) * rise[right]
        )
        delayed[:begin] = value[0] + rise[0] * (np.arange(begin) - delay)
        delayed[end:] = value[-1] + rise[-1] * (np.arange(end, n_samples) - delay - (n_samples - 1))
    return delayed


def read_ahead(structure: Structure, held: HeldInput, p: Floats) -> tuple[HeldInput, Floats]:
    """Return input and parameters, with the measured motion of delayed sensors advanced by the delays of the first set."""
    delays = structure.observed_delays
    if not delays:
        return held, p
    own = p.copy()
    for sensor, delay in delays.items():
        by = float(at_parameters(structure, delay, p if p.ndim == 1 else p[:, 0]))
        if not np.isfinite(by):
            continue
        own[structure.names.index(ahead_name(sensor))] = by
        held = held.read_ahead(len(structure.rig.inputs) + structure.observed.index(sensor), by)
    return held, own
