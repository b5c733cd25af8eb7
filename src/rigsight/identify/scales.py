"""How large each base quantity is in a campaign, so that searches start and step in characteristic units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.records.record import Record
from rigsight.rigs import Rig, evaluated
from rigsight.simulate.prescribed_motion import smooth_motion

_MOST = 98.0


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
        Constants and identified linear parameters of the rig, by name.

    Returns
    -------
    ``x`` displacement, ``input``, ``drive`` (force of the drive), ``force`` (of the spring), ``time`` [s] (reciprocal of the
    angular frequency of the motion) and ``length`` (size of the second output, 1 where there is none).
    """
    if not rig.is_driven:
        return _prescribed(rig, records)
    displacement = _size([record[rig.outputs[0].name] for record in records])
    drive_input = _size([record[rig.inputs[0].name] for record in records])
    motion = rig.motion
    gain, stiffness, inertia = (
        evaluated(part, values) for part in (motion.drive_gain, motion.stiffness, motion.inertia)
    )
    omega = np.sqrt(stiffness / inertia) if stiffness > 0.0 else _typical_omega(rig, records)
    spring = stiffness * displacement if stiffness > 0.0 else inertia * omega**2 * displacement
    length = 1.0
    if len(rig.outputs) > 1:
        seconds = [r[rig.outputs[1].name] for r in records if rig.outputs[1].name in r]
        length = _size(seconds) if seconds else 1.0
    return {
        "x": displacement,
        "input": drive_input,
        "drive": abs(gain) * drive_input,
        "force": float(spring),
        "time": float(1.0 / omega),
        "length": length,
    }


def _prescribed(rig: Rig, records: Sequence[Record]) -> dict[str, float]:
    motions = [smooth_motion(r[rig.inputs[0].name], r.dt) for r in records]
    displacement = _size([x for x, _ in motions])
    velocity = _size([v for _, v in motions])
    force = _size([r[rig.outputs[0].name] for r in records])
    return {
        "x": displacement,
        "force": force,
        "drive": force,
        "time": displacement / velocity,
        "input": displacement,
        "length": displacement,
    }


def _size(signals: Sequence[NDArray[np.float64]]) -> float:
    """Return what all but the rarest deviations from the middle stay below; never zero."""
    deviations = np.concatenate([np.abs(signal - np.median(signal)) for signal in signals])
    size = float(np.percentile(deviations, _MOST)) or float(np.max(deviations))
    return size or 1.0


def _typical_omega(rig: Rig, records: Sequence[Record]) -> float:
    name = rig.outputs[0].name
    ratios = [_size([np.gradient(record[name], record.dt)]) / _size([record[name]]) for record in records]
    return float(np.median(ratios))
