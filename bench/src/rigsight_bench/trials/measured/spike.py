"""Add a known cause to measured records: afterwards they are those of the same rig with this effect.

With ``m a + ... = u`` measured, ``u' = u + F(x, v)`` is the log of the same rig with the additional joint force F. Noise,
disturbances and inexact laws stay those of the real rig.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.signal import lfilter

from rigsight.effects import Effect, kind_of
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.errors import SimulationError
from rigsight.inverse import RecordMotion, effect_force, joint_motion, record_motion
from rigsight.records import Record
from rigsight.rigs import evaluated
from rigsight.rigs.rig import joint_of
from rigsight_bench.trials.measured.base import Base
from rigsight_bench.trials.measured.spots import DELAYS, Spot

Floats = NDArray[np.float64]

_SETTLED = 5.0
"""Time constants of a lag after which its start is forgotten."""
_MOST_LOST = 0.25
"""Share of a record that a delay or lag may cost."""


def whole_samples(spot: Spot, values: Mapping[str, float], dt: float) -> dict[str, float]:
    """Return the parameters of an effect with a delay of whole samples, one at least.

    Parameters
    ----------
    spot
        Effect and place.
    values
        Its parameters by their own names.
    dt
        Sample time [s].
    """
    if kind_of(spot.effect.name) not in DELAYS:
        return dict(values)
    return {name: math.copysign(max(round(abs(value) / dt), 1) * dt, value) for name, value in values.items()}


def spiked(base: Base, spot: Spot, values: Mapping[str, float], record: Record) -> Record:
    """Return a record of the same rig with an additional effect.

    Parameters
    ----------
    base
        The rig's base equations.
    spot
        Effect and place.
    values
        Parameters of the effect by their own names.
    record
        As it was measured.

    Raises
    ------
    SimulationError
        If the effect cannot be evaluated along the motion, or a delay is too long for the record.
    """
    changed = _changed(base, spot, values, record)
    if not all(np.all(np.isfinite(changed[name])) for name in changed.signals):
        raise SimulationError(f"{spot.effect.name} cannot be evaluated along the record '{record.name}'.")
    return changed


def unspiked(record: Record, changed: Record) -> Record:
    """Return the stretch of a measured record that a changed one covers.

    Parameters
    ----------
    record
        As it was measured.
    changed
        What `spiked` makes of it.
    """
    first = round((changed.t0 - record.t0) / record.dt)
    return record.slice(first, first + changed.n_samples)


def _changed(base: Base, spot: Spot, values: Mapping[str, float], record: Record) -> Record:
    kind = kind_of(spot.effect.name)
    signal = record[spot.signal] if spot.signal in record else np.zeros(record.n_samples)
    if kind in DELAYS:
        (delay,) = values.values()
        late = round(delay / record.dt)
        return _shifted(record, spot.signal, signal, -late if spot.way == "input" else late)
    if spot.way == "input":
        return _driven(record, spot.signal, signal + values["u_0"] * np.sign(signal))
    if kind == "sensor_lag":
        return _slow(record, spot.signal, signal, values["T_m"])
    if spot.way == "reading":
        return record.with_signals(**{spot.signal: _read(spot.effect, values, signal)})
    motion = record_motion(base.rig, record, base.values)
    if motion is None:
        raise SimulationError(f"The sensors of the record '{record.name}' do not show the motion.")
    if values.get(spot.effect.pulsation or "", 0.0) * record.dt > math.pi:
        raise SimulationError(f"{spot.effect.name} would be above half the sampling frequency.")
    joint = joint_of(base.rig, spot.effect)
    force = effect_force(spot.effect, values, joint_motion(motion, joint, base.values))
    added = force if spot.way == "force_in_reading" else force * _per_force(base, spot, motion)
    if not float(np.sqrt(np.mean(added**2))) <= base.size(spot.signal):
        raise SimulationError(f"{spot.effect.name} would be stronger than what moves the rig.")
    if spot.way == "force_in_reading":
        return record.with_signals(**{spot.signal: signal + added})
    if record.hold == "zoh":
        # An input that is held until the next sample: the mean of the force until then.
        added = 0.5 * (added + np.append(added[1:], added[-1]))
    return _driven(record, spot.signal, signal + added)


def _read(effect: Effect, values: Mapping[str, float], signal: Floats) -> Floats:
    """Return what a sensor with an error reads, shape (n_samples,)."""
    own = [sp.Symbol(name, real=True) for name in values]
    assert effect.measured is not None
    both = [effect.measured, derivative(effect.measured, canonical.reading)]
    reading, slope = sp.lambdify([canonical.reading, *own], both, "numpy")(signal, *values.values())
    if not np.all(slope > 0.0):
        raise SimulationError(f"{effect.name} would let the reading run backwards.")
    return np.asarray(reading)


def _per_force(base: Base, spot: Spot, motion: RecordMotion) -> Floats:
    """Return the input that overcomes a unit of force at the joint, shape (n_samples,)."""
    equations, numbers = motion.equations, {**base.values, **motion.record.constants}
    along = equations.slopes_along(motion.z, motion.u, equations.parameters(base.values, motion.record))
    drive = next(drive for drive in base.rig.mechanism.drives if drive.name == spot.drive)
    mine, its = along[joint_of(base.rig, spot.effect).name], along[drive.name]
    ratio = np.sum(mine * its, axis=0) / np.sum(its**2, axis=0)
    return np.asarray(ratio / evaluated(derivative(drive.force, sp.Symbol(drive.name, real=True)), numbers))


def _driven(record: Record, name: str, signal: Floats) -> Record:
    """Return a record with another input, which is none of a generator any more."""
    return replace(record.with_signals(**{name: signal}), kind="operation", amplitude=None)


def _shifted(record: Record, name: str, signal: Floats, late: int) -> Record:
    """Return the part of a record that remains if one of its signals is logged later by so many samples, or earlier."""
    n = record.n_samples - abs(late)
    if n < (1.0 - _MOST_LOST) * record.n_samples:
        raise SimulationError(f"A delay of {abs(late)} samples is too long for the record '{record.name}'.")
    first, of_signal = (late, 0) if late > 0 else (0, -late)
    return record.slice(first, first + n).with_signals(**{name: signal[of_signal : of_signal + n]})


def _slow(record: Record, name: str, signal: Floats, time_constant: float) -> Record:
    """Return the part of a record from which on the start of a lag of one reading is forgotten."""
    lost = math.ceil(_SETTLED * time_constant / record.dt)
    if lost > _MOST_LOST * record.n_samples:
        raise SimulationError(f"A lag of {time_constant:.3g} s is too long for the record '{record.name}'.")
    # Exact for a reading that is linear between its samples.
    stays = math.exp(-record.dt / time_constant)
    mean = (1.0 - stays) * time_constant / record.dt
    slow = signal[0] + lfilter([1.0 - mean, mean - stays], [1.0, -stays], signal - signal[0])
    return record.with_signals(**{name: slow}).slice(lost, None)
