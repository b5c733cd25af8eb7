"""Which effects do the designs draw from? Those they had when their trials were counted; a new one changes no trial.

An effect that the catalogue gets later is in no design unless somebody makes a design of it.
"""

from __future__ import annotations

from functools import cache

from rigsight.effects import Effect, effect_named

COUNTED_EFFECTS: tuple[str, ...] = (
    "bouc_wen_hysteresis", "iwan_hysteresis", "maxwell_branch", "coulomb_friction", "stribeck_friction",
    "directional_friction", "load_dependent_friction", "presliding_friction", "quadratic_damping", "position_dependent_damping",
    "cubic_stiffness", "power_law_stiffness", "gravity_pendulum", "torque_ripple", "end_stop", "free_play", "backlash",
    "asymmetric_stiffness", "flexible_mode", "inertia", "input_delay", "actuator_lag", "input_saturation", "speed_limit",
    "input_dead_zone", "periodic_disturbance", "creep_saturation", "conicity_variation", "sensor_delay", "sensor_lag",
    "time_shift", "encoder_eccentricity",
)  # fmt: skip
"""In the order in which they are drawn, whatever the order of the catalogue."""


@cache
def counted_effects() -> tuple[Effect, ...]:
    """Return the effects that designs draw from, in the order in which they are drawn."""
    return tuple(effect_named(name) for name in COUNTED_EFFECTS)
