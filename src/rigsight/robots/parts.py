"""Actuators and sensors of a MuJoCo model that a rig file can represent, and names of all else: nothing is dropped silently."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mujoco


_LISTED = 3
"""Names that one line lists; the rest is counted."""


@dataclass(frozen=True)
class TreeActuator:
    """An actuator at a hinge or slide joint: ``gear * clip(gain * a + bias_0 + bias_1 * length + bias_2 * speed)``."""

    # Its number in the model, and those of its control and its joint.
    index: int
    control: int
    joint: int
    name: str  # as MuJoCo calls it; empty without a name
    gear: float  # its length is so many times the coordinate, its force at the joint so many times its own
    # Numbers of the law; a is the control, or what a filter makes of it.
    gain: float
    bias: tuple[float, float, float]
    # Where the control and the force end; None without an end.
    control_range: tuple[float, float] | None
    force_range: tuple[float, float] | None
    time_constant: float  # of the filter between the control and a [s]; 0 without one

    @property
    def holds_position(self) -> bool:
        """True for the law of ``position``: a proportional gain, with or without damping."""
        return self.gain != 0.0 and self.bias[0] == 0.0 and self.bias[1] == -self.gain

    @property
    def holds_velocity(self) -> bool:
        """True for the law of ``velocity``."""
        return self.gain != 0.0 and self.bias[:2] == (0.0, 0.0) and self.bias[2] == -self.gain


def actuators_of(model: mujoco.MjModel) -> tuple[list[TreeActuator], list[str]]:
    """Return the actuators that a rig file can represent, and descriptions of the others with the reason."""
    import mujoco

    found, left_out = [], []
    joints = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    fixed, none = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtBias.mjBIAS_NONE)
    affine = int(mujoco.mjtBias.mjBIAS_AFFINE)
    filters = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
    still = int(mujoco.mjtDyn.mjDYN_NONE)
    rotating = (int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL))
    unclamped = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    for index in range(model.nactuator):
        name = model.actuator(index).name
        called = f"actuator '{name}'" if name else f"actuator number {index}"
        dynamics, bias_kind = int(model.actuator_dyntype[index]), int(model.actuator_biastype[index])
        if int(model.actuator_trntype[index]) not in joints:
            left_out.append(f"{called}: it does not drive a joint but a tendon, site or body")
            continue
        if int(model.jnt_type[model.actuator_trnid[index, 0]]) in rotating:
            left_out.append(f"{called}: it drives a free or ball joint")
            continue
        if int(model.actuator_gaintype[index]) != fixed or bias_kind not in (none, affine):
            left_out.append(f"{called}: a muscle, motor model, plugin or gain that changes with the motion")
            continue
        if int(model.actuator_ctrlnum[index]) != 1:
            left_out.append(f"{called}: it takes several controls")
            continue
        if dynamics not in (still, *filters):
            left_out.append(f"{called}: activation dynamics other than a filter")
            continue
        first, second, third = map(
            float, model.actuator_biasprm[index, :3] if bias_kind == affine else (0.0,) * 3
        )
        control = int(model.actuator_ctrladr[index])
        clamped = bool(model.actuator_ctrllimited[control]) and not unclamped
        found.append(
            TreeActuator(
                index,
                control,
                int(model.actuator_trnid[index, 0]),
                name,
                float(model.actuator_gear[index, 0]),
                float(model.actuator_gainprm[index, 0]),
                (first, second, third),
                _range(clamped, model.actuator_ctrlrange[control]),
                _range(bool(model.actuator_forcelimited[index]), model.actuator_forcerange[index]),
                float(model.actuator_dynprm[index, 0]) if dynamics in filters else 0.0,
            )
        )
        left_out += _beside(model, index, called)
    return found, left_out


def _beside(model: mujoco.MjModel, index: int, called: str) -> list[str]:
    """Return descriptions of the properties of an accepted actuator that are not taken over."""
    found = []
    delay = float(model.actuator_delay[index])
    if delay > 0.0:
        found.append(
            f'{called}: its delay of {delay:g} s; declare it in a campaign by effects = ["input_delay@DRIVE"] and T_d'
        )
    if (
        float(model.actuator_armature[index])
        or model.actuator_damping[index]
        or model.actuator_dampingpoly[index].any()
    ):
        found.append(f"{called}: its own armature and damping; give them to the joint")
    if model.actuator_actlimited[index]:
        found.append(f"{called}: the range of its activation")
    return found


def _range(limited: bool, ends: tuple[float, float]) -> tuple[float, float] | None:
    return (float(ends[0]), float(ends[1])) if limited else None


@dataclass(frozen=True)
class TreeSensor:
    """A sensor that reads so many times the coordinate of a joint, or its rate."""

    # Its number in the model, and that of its joint.
    index: int
    joint: int
    name: str  # as MuJoCo calls it; empty without a name
    factor: float  # 1, or the gear of an actuator
    is_rate: bool  # true if it reads the rate


def sensors_of(
    model: mujoco.MjModel, actuators: list[TreeActuator], of_free_joints: Collection[int] = ()
) -> tuple[list[TreeSensor], list[str]]:
    """Return the sensors that a rig file can represent, and descriptions of the others but those of free joints."""
    import mujoco

    sort = mujoco.mjtSensor
    at_joints = {int(sort.mjSENS_JOINTPOS): False, int(sort.mjSENS_JOINTVEL): True}
    at_actuators = {int(sort.mjSENS_ACTUATORPOS): False, int(sort.mjSENS_ACTUATORVEL): True}
    by_index = {actuator.index: actuator for actuator in actuators}
    found, left_out = [], []
    for index in (index for index in range(model.nsensor) if index not in of_free_joints):
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


def left_out_of(model: mujoco.MjModel, *, as_it_is: bool = False) -> list[str]:
    """Return descriptions of what is not taken over of a model, apart from its actuators and sensors."""
    found = [f"the option that switches off {what}, which the rig has" for what in _switched_off(model)]
    if not as_it_is:
        found += _between_bodies(model)
    if any(model.jnt_springyield):
        found.append("springs that yield")
    if any(model.jnt_actfrclimited):
        found.append(
            f"range of the actuators' force at joints: {_listed(_joints(model, model.jnt_actfrclimited))}"
        )
    return found


def _joints(model: mujoco.MjModel, chosen: Sequence[bool]) -> list[str]:
    return [model.joint(j).name or f"number {j}" for j in range(model.njnt) if chosen[j]]


def _between_bodies(model: mujoco.MjModel) -> list[str]:
    found = []
    if touching := _touching(model):
        found.append(f"contacts between bodies: {_listed(touching)}")
    if limited := _joints(model, model.jnt_limited):
        found.append(
            f"range of joints: {_listed(limited)}; the rig has no end stops there; use the effect end_stop"
        )
    if model.neq:
        found.append(
            f"{model.neq} equality constraint{'' if model.neq == 1 else 's'}: each joint moves by itself"
        )
    if model.ntendon:
        found.append(f"{model.ntendon} tendon{'' if model.ntendon == 1 else 's'}")
    if model.opt.density or model.opt.viscosity:
        found.append("forces of the fluid around the bodies (density, viscosity)")
    if model.nflex or model.nplugin:
        found.append("deformable bodies and plugins")
    return found


def _switched_off(model: mujoco.MjModel) -> list[str]:
    import mujoco

    off = mujoco.mjtDisableBit
    flags = {
        off.mjDSBL_SPRING: "springs of joints",
        off.mjDSBL_DAMPER: "damping of joints",
        off.mjDSBL_FRICTIONLOSS: "dry friction",
        off.mjDSBL_ACTUATION: "actuators",
    }
    return [what for flag, what in flags.items() if model.opt.disableflags & int(flag)]


def _touching(model: mujoco.MjModel) -> list[str]:
    """Return the pairs of bodies whose shapes may touch: not parent and child, not welded together, not excluded."""
    import mujoco

    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT):
        return []
    excluded = {(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature}
    bodies: dict[int, list[int]] = {}
    for geom in range(model.ngeom):
        if model.geom_contype[geom] or model.geom_conaffinity[geom]:
            bodies.setdefault(int(model.body_weldid[model.geom_bodyid[geom]]), []).append(geom)
    found = []
    for first, second in combinations(sorted(bodies), 2):
        above, over = (int(model.body_weldid[model.body_parentid[own]]) for own in (first, second))
        related = first == over or second == above
        # The world collides with its children too, others do not.
        if (related and first != 0) or (first, second) in excluded or (second, first) in excluded:
            continue
        if any(
            model.geom_contype[a] & model.geom_conaffinity[b]
            or model.geom_contype[b] & model.geom_conaffinity[a]
            for a in bodies[first]
            for b in bodies[second]
        ):
            found.append(
                " and ".join(model.body(own).name or f"body number {own}" for own in (first, second))
            )
    return found


def _listed(names: list[str]) -> str:
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")
