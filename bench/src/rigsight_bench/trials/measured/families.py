"""Which effects are of one kind? To be replaced by `Effect.family` of `rigsight.effects` as soon as effects declare it."""

from __future__ import annotations

from rigsight.effects import kind_of

_MEMBERS = {
    "dry_friction": (
        "coulomb_friction", "stribeck_friction", "directional_friction", "load_dependent_friction", "presliding_friction",
    ),
    "memory": ("bouc_wen_hysteresis", "iwan_hysteresis"),
    "viscoelasticity": ("maxwell_branch",),
    "spring_law": ("cubic_stiffness", "asymmetric_stiffness", "power_law_stiffness"),
    "gravity": ("gravity_pendulum",),
    "damping_law": ("quadratic_damping", "position_dependent_damping"),
    "play_and_stops": ("free_play", "backlash", "end_stop"),
    "delay_or_lag": ("input_delay", "actuator_lag", "sensor_delay", "sensor_lag", "time_shift"),
    "drive_limit": ("input_saturation", "input_dead_zone", "speed_limit"),
    "tone_or_ripple": ("periodic_disturbance", "torque_ripple", "encoder_eccentricity"),
    "resonance": ("flexible_mode",),
    "inertia": ("inertia",),
    "contact": ("creep_saturation", "conicity_variation"),
}  # fmt: skip
_FAMILIES = {name: family for family, names in _MEMBERS.items() for name in names}
_OWN = "own"


def family_of(effect: str) -> str:
    """Return the family of an effect, with or without its place; ``"own"`` for one that is not in the catalogue.

    Parameters
    ----------
    effect
        Its name.
    """
    return _FAMILIES.get(kind_of(effect), _OWN)
