"""Which field of a MuJoCo model says the same as an effect? As of MuJoCo 4.0."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

_SLACK = 2
"""Samples of a control's history beyond its delay: one for the step in hand, one for rounding."""

_LINEAR = 1
"""How a history is read between two steps: a delay need be no whole number of them."""
_NO_MOTOR = 1e-9
"""Motor constant that has to be positive: it damps by its square over the resistance."""

Write = Callable[[Any, Mapping[str, float], Any], str | None]
"""Writes an effect's own values into an element of a model, and says why not where it cannot."""


@dataclass(frozen=True)
class EffectField:
    """Where an effect is written."""

    element: str  # ``"joint"``, ``"actuator"`` or ``"sensor"``
    attribute: str  # for people
    write: Write  # does it


def _added(attribute: str, own: str, entry: int | None = None) -> Write:
    def write(element: Any, values: Mapping[str, float], _: Any) -> None:
        if entry is None:
            setattr(element, attribute, float(getattr(element, attribute)) + values[own])
        else:
            getattr(element, attribute)[entry] += values[own]

    return write


def _late(own: str) -> Write:
    def write(element: Any, values: Mapping[str, float], spec: Any) -> None:
        late, options = values[own], spec.option
        if own == "T_d" and _is_runge_kutta(spec) and element.delay <= 0.0:
            # The Runge-Kutta method reads on within a step, where a controller holds its command: half a step early on average.
            late += 0.5 * options.timestep
        element.delay = max(float(element.delay), 0.0) + late
        element.nsample = max(element.nsample, int(element.delay / options.timestep) + _SLACK)
        element.interp = _LINEAR

    return write


def _is_runge_kutta(spec: Any) -> bool:
    import mujoco

    return bool(spec.option.integrator == int(mujoco.mjtIntegrator.mjINT_RK4))


def _cogging(element: Any, values: Mapping[str, float], spec: Any) -> None:
    # The motor pushes with ``A sin(N q + phase)``, while the ripple resists.
    sine, cosine = -values["T_sin"], -values["T_cos"]
    shape = [math.hypot(sine, cosine), values["kappa"], math.atan2(cosine, sine)]
    _add_idle_motor(element, spec, "cogging", cogging=shape)


def _bristles(element: Any, values: Mapping[str, float], spec: Any) -> None:
    # Presliding friction is the same law with one friction at all speeds: any Stribeck velocity will do.
    moving, x_p = values["T_c"], values["x_p"]
    resting = moving * (1.0 + values.get("s", 0.0))
    bristles = [resting / x_p, 0.0, moving, resting, values.get("w_s", 1.0)]
    _add_idle_motor(element, spec, "friction", lugre=bristles)


def _add_idle_motor(joint: Any, spec: Any, what: str, **parts: list[float]) -> None:
    """Add a motor without a control to a joint, for what MuJoCo has in motors alone."""
    import mujoco

    joint.name = joint.name or f"joint_{joint.id}"
    motor = spec.add_actuator(
        name=f"{joint.name}_{what}", target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
    )
    motor.set_to_dcmotor(
        motorconst=[_NO_MOTOR] * 2, resistance=1.0, ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_NONE), **parts
    )


def _limited(element: Any, values: Mapping[str, float], _: Any) -> str | None:
    _narrow(element.ctrlrange, values["u_max"])
    element.ctrllimited = True
    return None


def _narrow(ends: Any, size: float) -> None:
    """Keep a range, which may be none yet, within +-size."""
    if ends[0] < ends[1]:
        ends[:] = (max(-size, float(ends[0])), min(size, float(ends[1])))
    else:
        ends[:] = (-size, size)


def _filtered(element: Any, values: Mapping[str, float], spec: Any) -> str | None:
    import mujoco

    if element.dyntype != mujoco.mjtDyn.mjDYN_NONE:
        return "the actuator has a filter already"
    element.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
    # MuJoCo advances a filter from step to step: under the Runge-Kutta method it comes half a step later than its equation.
    late = 0.5 * spec.option.timestep if _is_runge_kutta(spec) else 0.0
    element.dynprm[0] = max(values["T_a"] - late, 0.0)
    return None


def _regulated(element: Any, values: Mapping[str, float], _: Any) -> str | None:
    """Make a position controller one with integral action and a limited rate of its control."""
    import mujoco

    kp, kv = -float(element.biasprm[1]), -float(element.biasprm[2])
    ki, slewmax = 0.0, 0.0
    if element.gaintype == mujoco.mjtGain.mjGAIN_PID:
        ki, slewmax = float(element.gainprm[0]), float(element.dynprm[1])
    elif not _is_position_controller(element) or element.dyntype != mujoco.mjtDyn.mjDYN_NONE:
        return "the actuator is no position controller, or has a filter"
    ki += kp * values.get("r_i", 0.0)
    slewmax = values.get("w_c", slewmax)
    # Its only control remains the goal: by itself it would take one for the velocity, too.
    goal = int(mujoco.mjtCtrlInput.mjINPUT_POS)
    element.set_to_pid(kp=kp, kv=kv, ki=ki or -1.0, slewmax=slewmax or -1.0, ctrlspec=goal)
    return None


def _force_limited(element: Any, values: Mapping[str, float], _: Any) -> str | None:
    if not _is_position_controller(element):
        return "the actuator is no position controller"
    _narrow(element.forcerange, values["o_max"] * abs(float(element.biasprm[1])))
    element.forcelimited = True
    return None


def _is_position_controller(element: Any) -> bool:
    import mujoco

    is_affine = element.biastype == mujoco.mjtBias.mjBIAS_AFFINE and element.biasprm[1] < 0.0
    of_gain = element.gaintype == mujoco.mjtGain.mjGAIN_PID or element.gainprm[0] == -element.biasprm[1]
    return bool(is_affine and of_gain)


EFFECT_FIELDS: Mapping[str, EffectField] = {
    "coulomb_friction": EffectField("joint", "frictionloss", _added("frictionloss", "T_c")),
    "quadratic_damping": EffectField("joint", "damping, second number", _added("damping", "c_2", 1)),
    "asymmetric_stiffness": EffectField("joint", "stiffness, second number", _added("stiffness", "k_2", 1)),
    "cubic_stiffness": EffectField("joint", "stiffness, third number", _added("stiffness", "k_3", 2)),
    "torque_ripple": EffectField("joint", "actuator dcmotor, cogging", _cogging),
    "presliding_friction": EffectField("joint", "actuator dcmotor, lugre", _bristles),
    "lugre_friction": EffectField("joint", "actuator dcmotor, lugre", _bristles),
    "input_delay": EffectField("actuator", "delay", _late("T_d")),
    "input_saturation": EffectField("actuator", "ctrlrange", _limited),
    "actuator_lag": EffectField("actuator", "dyntype filterexact", _filtered),
    "integral_action": EffectField("actuator", "gaintype pid, integral gain", _regulated),
    "command_rate_limit": EffectField("actuator", "gaintype pid, largest rate", _regulated),
    "controller_saturation": EffectField("actuator", "forcerange", _force_limited),
    "sensor_delay": EffectField("sensor", "delay", _late("T_s")),
}
"""By the name of the effect, as of MuJoCo 4.0."""
