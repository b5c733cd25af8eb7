"""Field of MuJoCo for an effect at its place; many effects have none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

_SLACK = 2
"""Samples of a control's history beyond its delay: one for the step in hand, one for rounding."""

Write = Callable[[Any, Mapping[str, float], Any], str | None]
"""Writes an effect's own values into an element, given the model's options, and says why not where it cannot."""
_LINEAR = 1
"""How a history is read between two steps: a delay need be no whole number of them."""


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
    def write(element: Any, values: Mapping[str, float], options: Any) -> str | None:
        import mujoco

        late = values[own]
        if (
            own == "T_d"
            and options.integrator == int(mujoco.mjtIntegrator.mjINT_RK4)
            and element.delay <= 0.0
        ):
            # The Runge-Kutta method reads on within a step, where a controller holds its command: half a step early on average.
            late += 0.5 * options.timestep
        element.delay = max(float(element.delay), 0.0) + late
        element.nsample = max(element.nsample, int(element.delay / options.timestep) + _SLACK)
        element.interp = _LINEAR
        return None

    return write


def _limited(element: Any, values: Mapping[str, float], _: Any) -> str | None:
    size = values["u_max"]
    low, high = (-size, size)
    if element.ctrlrange[0] < element.ctrlrange[1]:
        low, high = max(low, float(element.ctrlrange[0])), min(high, float(element.ctrlrange[1]))
    element.ctrlrange[:] = (low, high)
    element.ctrllimited = True
    return None


def _filtered(element: Any, values: Mapping[str, float], _: Any) -> str | None:
    import mujoco

    if element.dyntype != mujoco.mjtDyn.mjDYN_NONE:
        return "the actuator has a filter already"
    element.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
    element.dynprm[0] = values["T_a"]
    return None


EFFECT_FIELDS: Mapping[str, EffectField] = {
    "coulomb_friction": EffectField("joint", "frictionloss", _added("frictionloss", "T_c")),
    "quadratic_damping": EffectField("joint", "damping, second number", _added("damping", "c_2", 1)),
    "asymmetric_stiffness": EffectField("joint", "stiffness, second number", _added("stiffness", "k_2", 1)),
    "cubic_stiffness": EffectField("joint", "stiffness, third number", _added("stiffness", "k_3", 2)),
    "input_delay": EffectField("actuator", "delay", _late("T_d")),
    "input_saturation": EffectField("actuator", "ctrlrange", _limited),
    "actuator_lag": EffectField("actuator", "dyntype filterexact", _filtered),
    "sensor_delay": EffectField("sensor", "delay", _late("T_s")),
}
"""By the name of the effect, as of MuJoCo 4.0."""
