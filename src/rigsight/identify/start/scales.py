"""Characteristic size of each base quantity in a campaign, as units of searches.

They follow from the motion in the records: of several bodies as measured where the sensors show all of it, else according to the
equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigsight.errors import SimulationError
from rigsight.identify.fit.first_states import rig_state
from rigsight.identify.fit.windows import pieces
from rigsight.identify.rig_equations import RigEquations, equations_of
from rigsight.identify.start.measured_states import measured_states, sensor_factors
from rigsight.records.record import Floats, Record
from rigsight.records.signals import is_constant, size_about_zero, size_of_signal, typical_size
from rigsight.rigs import Rig, evaluated
from rigsight.simulate import simulate_outputs
from rigsight.simulate.prescribed_motion import smooth_motion
from rigsight.units import matters_at, size_of

_ACCURACY = 1e-4
"""Relative accuracy of the simulation, more than sufficient for sizes."""
_PIECES = (1, 20)
"""Numbers of pieces into which a record is cut, in turn, until the motion can be simulated and has about the measured size. Each
piece starts from the measured state, because an unstable or drifting rig leaves the measured motion after some time."""
_BEYOND = 3.0
"""Largest ratio of simulated to measured motion; a rig with estimated parameters at its resonance stays below."""
_Signals = Mapping[str, list[Floats]]
_LEAST_SHARE = 1e-3
"""Share of the value at which a parameter is as important as any other term. A parameter below this share gets this size, because
steps relative to its value would be lost in rounding."""
_UNKNOWN = 1.0
"""Size of a quantity that is zero everywhere."""


def motion_in_record(
    equations: RigEquations, record: Record, values: Mapping[str, float]
) -> tuple[Floats, Floats]:
    """Return states and inputs with their derivatives in a record by rows: as measured or by the equations."""
    u = equations.inputs_of(record)[1]
    # The first states of each piece of several bodies take seconds, where the sensors show all of them anyway.
    if not equations.rig.has_one_motion and equations.shows_all_states(set(record.signals)):
        p = equations.parameters(values, record)
        measured = measured_states(equations, record, p, sensor_factors(equations, frozenset()))
        if measured is not None and not measured.is_integrated:
            return measured.z, u
    found: Floats | None = None
    for count in _PIECES:
        try:
            own = [_states(equations, piece, values) for piece in pieces(record, count)]
        except SimulationError:
            continue
        found = np.concatenate(own, axis=1)
        if _within_reach(equations, record, values, found, u):
            break
    if found is None:
        # Used if the motion cannot be simulated.
        found = np.repeat(rig_state(equations, record, values)[:, None], record.n_samples, axis=1)
    return found, u


def _states(equations: RigEquations, record: Record, values: Mapping[str, float]) -> Floats:
    structure = equations.structure
    held, p = equations.inputs_of(record)[0], equations.parameters(values, record)
    start = rig_state(equations, record, values)
    out = simulate_outputs(structure, held, p, start, record.n_samples, _ACCURACY)
    return out[:, len(equations.sensor_names) :].T


def _within_reach(
    equations: RigEquations, record: Record, values: Mapping[str, float], z: Floats, u: Floats
) -> bool:
    """Return True if no simulated reading has a much larger range than the measured one."""
    shown = equations.readings(z, u, equations.parameters(values, record))
    return all(
        np.ptp(reading) <= _BEYOND * np.ptp(record[name]) or np.ptp(record[name]) == 0.0
        for name, reading in zip(equations.sensor_names, shown, strict=True)
        if name in record
    )


def scales_at_places(rig: Rig, records: Sequence[Record], values: Mapping[str, float]) -> dict[str, float]:
    """Return the size of each base quantity at each place of a rig, and of each of its parameters and states."""
    equations = equations_of(rig)
    signals: dict[str, list[Floats]] = {}
    own_sizes: list[Floats] = []
    for record in records:
        found, own_size = _in_record(equations, record, values)
        own_sizes.append(own_size)
        for name, samples in found.items():
            signals.setdefault(name, []).append(samples)
    seen = [
        sensor.reads for sensor in rig.mechanism.sensors if any(sensor.name in record for record in records)
    ]
    shown = {symbol for reads in seen for symbol in reads.free_symbols}
    free = {coordinate.symbol for coordinate in rig.mechanism.free}
    joints = {
        joint.name: _of_joint(joint.name, signals, joint.motion.free_symbols & free <= shown)
        for joint in rig.mechanism.joints
    }
    first = next(iter(joints.values()), dict.fromkeys(("x", "travel", "force", "drive", "time"), _UNKNOWN))
    sources = [size_of_signal(signals[f"input {s.name}"]) for s in rig.inputs]
    own_states = [f"value {state.name}" for state in rig.mechanism.states]
    length = size_of_signal(signals[own_states[0]]) if own_states else _UNKNOWN
    plain = {**first, "input": next(iter(sources), 0.0) or _UNKNOWN, "length": length or _UNKNOWN}
    places: dict[str, dict[str, float]] = {name: {**plain, **sizes} for name, sizes in joints.items()}
    for drive in rig.mechanism.drives:
        moved = next((name for name in joints if f"{drive.name}>{name}" in signals), None)
        own = {
            "input": size_of_signal(signals[f"signal@{drive.name}"]),
            "drive": size_of_signal(signals[f"force@{drive.name}"]),
        }
        places[drive.name] = {**plain, **(joints[moved] if moved else {}), **_not_zero(own)}
    for name in [*(s.name for s in rig.mechanism.states), *equations.sensor_names]:
        key = f"reading@{name}" if name in equations.sensor_names else f"value {name}"
        slope = f"slope@{name}" if name in equations.sensor_names else f"change {name}"
        x = size_of_signal(signals[key])
        own = {
            "x": x,
            "travel": _travel(signals[key], is_shown=True),
            "time": _over(x, size_about_zero(signals[slope])),
        }
        places[name] = {**plain, **_not_zero(own)}
    scales = dict(plain)
    for place, sizes in places.items():
        scales |= {f"{base}@{place}": size for base, size in sizes.items()}
    for name in equations.state_names:
        scales[size_of(name)] = size_of_signal(signals[f"value {name}"]) or _UNKNOWN
    numbers = equations.parameters(values, records[0])
    for name, number, role in zip(equations.structure.names, numbers, np.min(own_sizes, axis=0), strict=True):
        least = _LEAST_SHARE * role if np.isfinite(role) else 0.0
        if np.isfinite(role):
            scales[matters_at(name)] = float(role)
        scales[size_of(name)] = float(max(abs(number), least)) or _UNKNOWN
    return scales


def _in_record(
    equations: RigEquations, record: Record, values: Mapping[str, float]
) -> tuple[dict[str, Floats], Floats]:
    """Return motions and forces at each place in a record, and the size at which each parameter matters."""
    z, u = motion_in_record(equations, record, values)
    p, n = equations.parameters(values, record), equations.n_coordinates
    rates = equations.rates(z, u, p)
    accelerations = rates[n : 2 * n]
    found = equations.at_places(z, u, p)
    found |= {f"value {name}": row for name, row in zip(equations.state_names, z, strict=True)}
    found |= {f"change {name}": row for name, row in zip(equations.state_names, rates, strict=True)}
    found |= {f"input {s.name}": record[s.name] for s in equations.rig.inputs}
    shown, slopes = equations.readings(z, u, p), equations.reading_slopes(z, u, p)
    for name, reading, slope in zip(equations.sensor_names, shown, slopes, strict=True):
        found |= {f"reading@{name}": record.signals.get(name, reading), f"slope@{name}": slope}
    found |= _inertial(equations, z, u, p, record.dt, found)
    return found, _own_sizes(equations, z, u, p, accelerations)


def _inertial(
    equations: RigEquations, z: Floats, u: Floats, p: Floats, dt: float, found: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Return the inertial force along each joint, and the force there with the same acceleration as each drive (``D>J``)."""
    mechanism, along = equations.rig.mechanism, equations.slopes_along(z, u, p)
    own: dict[str, Floats] = {}
    if equations.n_coordinates == 0 or z.shape[1] < 2:
        return own
    mobility = np.linalg.pinv(equations.mass(z, u, p))
    for joint in mechanism.joints:
        slopes = along[joint.name]
        if not np.any(slopes):
            continue
        inertia = 1.0 / np.einsum("ik,kij,jk->k", slopes, mobility, slopes)
        own[f"inertia@{joint.name}"] = inertia * np.gradient(found[f"rate@{joint.name}"], dt)
        for drive in mechanism.drives:
            share = inertia * np.einsum("ik,kij,jk->k", slopes, mobility, along[drive.name])
            if np.any(share):
                own[f"{drive.name}>{joint.name}"] = share * found[f"force@{drive.name}"]
    return own


def _of_joint(name: str, signals: _Signals, is_shown: bool) -> dict[str, float]:
    x = size_of_signal(signals[f"motion@{name}"])
    driven = [key for key in signals if key.endswith(f">{name}")]
    keys = [f"inertia@{name}", f"spring@{name}", f"damper@{name}", f"own@{name}", *driven]
    drive = max(size_of_signal(signals[key]) for key in keys if key in signals)
    force = size_of_signal(signals[f"spring@{name}"]) or drive
    time = _over(x, size_about_zero(signals[f"rate@{name}"]))
    travel = _travel(signals[f"motion@{name}"], is_shown)
    return _not_zero({"x": x, "travel": travel, "force": force, "drive": drive, "time": time})


def _travel(positions: Sequence[Floats], is_shown: bool) -> float:
    """Return the range of all positions; of those of one record where no sensor says how far records begin from each other."""
    return max(float(np.ptp(own)) for own in ([np.concatenate(positions)] if is_shown else positions))


def _own_sizes(equations: RigEquations, z: Floats, u: Floats, p: Floats, accelerations: Floats) -> Floats:
    """Return the size at which each parameter matters as much as the largest part of an equation, shape (n_parameters,)."""
    largest, changes = equations.changes_of_equations(z, u, p, accelerations)
    size = np.sqrt(np.mean(largest**2, axis=1))[:, None]
    change = np.sqrt(np.mean(changes**2, axis=2))
    with np.errstate(divide="ignore", invalid="ignore"):
        own = np.where((change > 0.0) & (size > 0.0), size / change, np.inf)
    return np.asarray(np.nanmin(np.where(np.isfinite(own), own, np.inf), axis=0))


def _over(x: float, rate: float) -> float:
    return x / rate if rate > 0.0 else 0.0


def _not_zero(sizes: Mapping[str, float]) -> dict[str, float]:
    return {base: size or _UNKNOWN for base, size in sizes.items()}


def characteristic_scales(
    rig: Rig, records: Sequence[Record], values: Mapping[str, float]
) -> dict[str, float]:
    """Return the size of each base quantity of `rigsight.units` in these records, for constants and parameters by name.

    ``x`` displacement, ``travel`` (its range, within one record where no sensor shows it), ``input``, ``drive`` (force of the
    drive), ``force`` (of the spring), ``time`` [s] (reciprocal of the angular frequency of the motion) and ``length`` (size of
    the rig's own first state, 1 if there is none), each without a place and at every joint, drive, sensor and state
    (``force@shaft``); for a rig with more than one motion also ``size@NAME`` for each of its parameters, coordinates, rates
    (``size@d(NAME)``) and states, and ``matters@NAME`` for each parameter: the size at which it matters as much as the largest
    part of an equation.
    """
    if not rig.has_one_motion:
        return scales_at_places(rig, records, values)
    plain = _of_one_motion(rig, records, values) if rig.is_driven else _prescribed(rig, records)
    mechanism = rig.mechanism
    places = [*(joint.name for joint in mechanism.joints), *(drive.name for drive in mechanism.drives)]
    scales = {**plain, **{f"{base}@{place}": size for place in places for base, size in plain.items()}}
    seen = {output.name: [r[output.name] for r in records if output.name in r] for output in rig.outputs}
    for name in [*seen, *(state.name for state in mechanism.states if state.name not in seen)]:
        own = dict[str, float]()
        if readings := seen.get(name):
            own = {"x": typical_size(readings), "travel": _travel(readings, is_shown=True) or _UNKNOWN}
        scales |= {f"{base}@{name}": size for base, size in {**plain, **own}.items()}
    return scales


def _of_one_motion(rig: Rig, records: Sequence[Record], values: Mapping[str, float]) -> dict[str, float]:
    moved = [record[rig.outputs[0].name] for record in records]
    displacement = typical_size(moved)
    drives = [record[rig.inputs[0].name] for record in records]
    drive_input, is_driven = typical_size(drives), not all(map(is_constant, drives))
    motion = rig.motion
    gain, stiffness, inertia = (
        evaluated(part, values) for part in (motion.drive_gain, motion.stiffness, motion.inertia)
    )
    omega = np.sqrt(stiffness / inertia) if stiffness > 0.0 else _typical_omega(rig, records)
    spring = stiffness * displacement if stiffness > 0.0 else inertia * omega**2 * displacement
    length = 1.0
    if len(rig.outputs) > 1:
        seconds = [r[rig.outputs[1].name] for r in records if rig.outputs[1].name in r]
        length = typical_size(seconds) if seconds else 1.0
    return {
        "x": displacement,
        "travel": _travel(moved, is_shown=True) or _UNKNOWN,
        "input": drive_input,
        # Without a drive, the spring force is the characteristic size of every force.
        "drive": abs(gain) * drive_input if is_driven else float(spring),
        "force": float(spring),
        "time": float(1.0 / omega),
        "length": length,
    }


def _prescribed(rig: Rig, records: Sequence[Record]) -> dict[str, float]:
    motions = [smooth_motion(r[rig.inputs[0].name], r.dt) for r in records]
    displacement = typical_size([x for x, _ in motions])
    velocity = typical_size([v for _, v in motions])
    force = typical_size([r[rig.outputs[0].name] for r in records])
    return {
        "x": displacement,
        "travel": _travel([x for x, _ in motions], is_shown=True) or _UNKNOWN,
        "force": force,
        "drive": force,
        "time": displacement / velocity,
        "input": displacement,
        "length": displacement,
    }


def _typical_omega(rig: Rig, records: Sequence[Record]) -> float:
    name = rig.outputs[0].name
    ratios = [
        typical_size([np.gradient(record[name], record.dt)]) / typical_size([record[name]])
        for record in records
    ]
    return float(np.median(ratios))
