"""Characteristic size of each base quantity in a campaign, as units of searches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigsight.identify.start.place_scales import scales_at_places
from rigsight.identify.typical_size import typical_size
from rigsight.records.record import Record
from rigsight.records.signals import is_constant
from rigsight.rigs import Rig, evaluated
from rigsight.simulate.prescribed_motion import smooth_motion


def characteristic_scales(
    rig: Rig, records: Sequence[Record], values: Mapping[str, float]
) -> dict[str, float]:
    """Return the size of each base quantity of `rigsight.units` in these records.

    Parameters
    ----------
    rig
        The rig.
    records
        Estimation records.
    values
        Constants and identified parameters of the rig, by name.

    Returns
    -------
    ``x`` displacement, ``input``, ``drive`` (force of the drive), ``force`` (of the spring), ``time`` [s] (reciprocal of the
    angular frequency of the motion) and ``length`` (size of the rig's own first state, 1 if there is none), each without a place
    and at every joint, drive, sensor and state (``force@shaft``); for a rig with more than one motion also ``size@NAME`` for each
    of its parameters, coordinates, rates (``size@d(NAME)``) and states.
    """
    if not rig.has_one_motion:
        return scales_at_places(rig, records, values)
    plain = _of_one_motion(rig, records, values) if rig.is_driven else _prescribed(rig, records)
    mechanism = rig.mechanism
    places = [*(joint.name for joint in mechanism.joints), *(drive.name for drive in mechanism.drives)]
    scales = {**plain, **{f"{base}@{place}": size for place in places for base, size in plain.items()}}
    seen = {output.name: [r[output.name] for r in records if output.name in r] for output in rig.outputs}
    for name in [*seen, *(state.name for state in mechanism.states if state.name not in seen)]:
        reading = typical_size(seen[name]) if seen.get(name) else plain["x"]
        scales |= {f"{base}@{name}": size for base, size in {**plain, "x": reading}.items()}
    return scales


def _of_one_motion(rig: Rig, records: Sequence[Record], values: Mapping[str, float]) -> dict[str, float]:
    displacement = typical_size([record[rig.outputs[0].name] for record in records])
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
