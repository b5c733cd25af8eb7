"""Sensors of a MuJoCo model that a rig file can represent: those that read the motion of a joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rigsight.robots.reading.actuators import TreeActuator

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True)
class TreeSensor:
    """A sensor that reads so many times the coordinate of a joint, or its rate."""

    # Its number in the model, and that of its joint.
    index: int
    joint: int
    name: str  # as MuJoCo calls it; empty without a name
    factor: float  # 1, or the gear of an actuator
    is_rate: bool  # true if it reads the rate


def sensors_of(model: mujoco.MjModel, actuators: list[TreeActuator]) -> tuple[list[TreeSensor], list[str]]:
    """Return the sensors that a rig file can represent, and descriptions of the others."""
    import mujoco

    sort = mujoco.mjtSensor
    at_joints = {int(sort.mjSENS_JOINTPOS): False, int(sort.mjSENS_JOINTVEL): True}
    at_actuators = {int(sort.mjSENS_ACTUATORPOS): False, int(sort.mjSENS_ACTUATORVEL): True}
    by_index = {actuator.index: actuator for actuator in actuators}
    found, left_out = [], []
    for index in range(model.nsensor):
        name, kind = model.sensor(index).name, int(model.sensor_type[index])
        called = f"sensor '{name}'" if name else f"sensor number {index}"
        target = int(model.sensor_objid[index])
        if kind in at_joints:
            found.append(TreeSensor(index, target, name, 1.0, at_joints[kind]))
        elif kind in at_actuators and target in by_index:
            read = by_index[target]
            found.append(TreeSensor(index, read.joint, name, read.gear, at_actuators[kind]))
        else:
            what = mujoco.mjtSensor(kind).name.removeprefix("mjSENS_").lower()
            left_out.append(f"{called} ({what}): it does not read the motion of a joint")
            continue
        if model.sensor_cutoff[index] > 0.0:
            left_out.append(f"{called}: its cutoff of {float(model.sensor_cutoff[index]):g}")
        if model.sensor_delay[index] > 0.0:
            left_out.append(
                f"{called}: its delay of {float(model.sensor_delay[index]):g} s; use the effect sensor_delay for it"
            )
    return found, left_out
