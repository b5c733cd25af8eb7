"""On which rig, with which numbers, is an effect tried?

The benches are one mass with a spring, the running gear for lateral effects, an element for those of a prescribed motion, and a
mass that follows its goal: with its controller as the force of a position drive, as the signal of a drive, and as an angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from rigsight.effects import Effect
from rigsight.rigs import AXIS, ELEMENT, RUNNING_GEAR, Rig, rig_of_tables

RESONANCE = 10.0
"""Angular frequency of the axis of the sine tests [rad/s]."""


@dataclass(frozen=True)
class Bench:
    """A rig with parameter values on which an effect is checked."""

    # The rig and its numbers.
    rig: Rig
    values: dict[str, float]
    output: str  # the output that the effect acts on
    # The parameter values of the rig in the sweeps from which the effect must be recovered.
    swept: dict[str, float]
    free: tuple[str, ...]  # parameters of the rig that are fitted together with those of the effect


AXIS_BENCH = Bench(
    AXIS,
    {"gain": 1.0, "m": 1.0, "d": 2.0, "k": RESONANCE**2, "x_off": 0.0, "force_off": 0.0},
    "x",
    {"gain": 2.0, "m": 1.5, "d": 4.0, "k": 300.0, "x_off": 1e-4, "force_off": 0.0},
    ("m", "d", "k", "x_off"),
)
_GEAR_VALUES = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98,
    "psi_off": 1e-4, "y_off": 1e-4,
}  # fmt: skip
GEAR_BENCH = Bench(
    RUNNING_GEAR, _GEAR_VALUES, "y", _GEAR_VALUES, ("J_z", "k_c", "k_d", "l_0", "c_y", "psi_off", "y_off")
)


def _drive(name: str, inertia: str, force: str, position: str) -> dict[str, Any]:
    """Return the rig file of a mass that follows its goal, in the units of its motion."""
    return {
        "name": name,
        "summary": "A mass follows its goal.",
        "inputs": {"goal": {"unit": position}},
        "constants": {"m_l": {"unit": inertia, "default": 0.6}},
        "parameters": {
            "m": {"unit": inertia, "lower": 1e-6},
            "d": {"unit": f"{force} s/{position}", "lower": 0.0},
            "k_p": {"unit": f"{force}/{position}", "lower": 0.0},
            "k_v": {"unit": f"{force} s/{position}", "lower": 0.0},
        },
        "coordinates": {"q": {"unit": position}},
        "energy": {"kinetic": "(m + m_l)*d(q)^2/2"},
        "joints": {"guide": {"motion": "q", "damping": "d"}},
        "drives": {"motor": {"signal": "goal", "force": "k_p*(motor - q) - k_v*d(q)", "along": "q"}},
        "sensors": {"x": {"reads": "q", "unit": position}},
    }


_SERVO = _drive("position_drive", "kg", "N", "m")
_TURNING = _drive("turning_drive", "kg m^2", "N m", "rad")
_LAW = {"motor": {"signal": "k_p*(goal - x) - k_v*speed", "force": "motor", "along": "q"}}
_SENSORS = {**_SERVO["sensors"], "speed": {"reads": "d(q)", "unit": "m/s"}}
_SERVO_VALUES = {"m_l": 0.6, "m": 0.4, "d": 1.0, "k_p": RESONANCE**2, "k_v": 3.0}
_ELEMENT_VALUES = {"d": 2.0, "k": RESONANCE**2, "force_off": 0.0}
ELEMENT_BENCH = Bench(ELEMENT, _ELEMENT_VALUES, "force", _ELEMENT_VALUES, ("d", "k", "force_off"))


@cache
def _with_controller() -> tuple[Bench, ...]:
    """Return the position drive, the mass whose control law is the signal of its drive, and the drive of an angle."""
    of_law = {**_SERVO, "name": "control_law", "drives": _LAW, "sensors": _SENSORS}
    rigs = (
        rig_of_tables(_SERVO, "Position drive"),
        rig_of_tables(of_law, "Control law"),
        rig_of_tables(_TURNING, "Turning drive"),
    )
    return tuple(Bench(rig, _SERVO_VALUES, "x", _SERVO_VALUES, ("m", "d")) for rig in rigs)


def bench_of(effect: Effect) -> Bench:
    """Return the bench on which an effect is tried: the first that offers it."""
    for bench in (AXIS_BENCH, GEAR_BENCH, ELEMENT_BENCH):
        if bench.rig.offers(effect):
            return bench
    return next((bench for bench in _with_controller() if bench.rig.offers(effect)), GEAR_BENCH)
