"""The actuators of a MuJoCo model: force of each as an expression of its control, with the values of its fields."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mujoco


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
    unclamped = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    for index in range(model.nactuator):
        name = model.actuator(index).name
        called = f"actuator '{name}'" if name else f"actuator number {index}"
        dynamics, bias_kind = int(model.actuator_dyntype[index]), int(model.actuator_biastype[index])
        if int(model.actuator_trntype[index]) not in joints:
            left_out.append(f"{called}: it does not drive a joint but a tendon, site or body")
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
        bias = (
            tuple(float(b) for b in model.actuator_biasprm[index, :3]) if bias_kind == affine else (0.0,) * 3
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
                (bias[0], bias[1], bias[2]),
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
