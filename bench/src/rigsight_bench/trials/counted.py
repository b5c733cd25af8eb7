"""Which effects and rigs do the designs draw from? Those they had when their trials were counted; a new one changes no trial.

An effect that the catalogue gets later, and a rig file that is added, are in no design unless somebody makes a design of them.
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
RELATED: frozenset[frozenset[str]] = frozenset({
    frozenset({"bouc_wen_hysteresis", "iwan_hysteresis"}), frozenset({"bouc_wen_hysteresis", "coulomb_friction"}),
    frozenset({"coulomb_friction", "stribeck_friction"}), frozenset({"cubic_stiffness", "gravity_pendulum"}),
    frozenset({"coulomb_friction", "load_dependent_friction"}), frozenset({"coulomb_friction", "presliding_friction"}),
    frozenset({"bouc_wen_hysteresis", "presliding_friction"}), frozenset({"iwan_hysteresis", "presliding_friction"}),
    frozenset({"cubic_stiffness", "power_law_stiffness"}), frozenset({"input_saturation", "speed_limit"}),
    frozenset({"input_delay", "time_shift"}),
})  # fmt: skip
"""Effects that are not hidden together, because one contains the other, or their readings are the same."""
COUNTED_RIGS: tuple[str, ...] = (
    "axis", "cart_pendulum", "drive_train", "element", "quarter_car", "running_gear", "servo", "two_link_arm",
)  # fmt: skip


@cache
def counted_effects() -> tuple[Effect, ...]:
    """Return the effects that designs draw from, in the order in which they are drawn."""
    return tuple(effect_named(name) for name in COUNTED_EFFECTS)
