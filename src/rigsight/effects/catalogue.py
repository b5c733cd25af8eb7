"""The effects that a diagnosis can name, one explicit list of their files."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from rigsight.effects.effect import Effect, Family
from rigsight.effects.placed import AT, placed
from rigsight.errors import check_option

_NAMES = """
    bouc_wen_hysteresis iwan_hysteresis maxwell_branch coulomb_friction stribeck_friction directional_friction
    load_dependent_friction load_dependent_stribeck_friction back_driving_friction presliding_friction lugre_friction
    quadratic_damping directional_damping position_dependent_damping cubic_stiffness power_law_stiffness
    gravity_pendulum torque_ripple end_stop free_play backlash asymmetric_stiffness flexible_mode flexible_gear
    inertia input_delay actuator_lag input_saturation speed_limit input_dead_zone integral_action speed_loop_integral
    derivative_action pid_action velocity_feedforward friction_compensation controller_dead_band controller_saturation
    command_rate_limit command_filter command_delay periodic_disturbance creep_saturation conicity_variation
    sensor_delay sensor_lag time_shift encoder_eccentricity rectified_sensor
"""
CATALOGUE: tuple[Effect, ...] = tuple(
    getattr(import_module(f"rigsight.effects.{name}"), name.upper()) for name in _NAMES.split()
)
"""In the order in which they are shown; each stands in a file of its name."""


def effect_named(name: str, known: Iterable[Effect] = CATALOGUE) -> Effect:
    """Return the known effect with this name, at its place where it names one: ``"coulomb_friction@shaft"``.

    Raises
    ------
    InputError
        Naming the nearest and all known effects.
    """
    effects = {effect.name: effect for effect in known}
    kind, at, place = name.partition(AT)
    effect = effects[check_option("Effect", kind, effects)]
    return placed(effect, place) if at else effect


def family_of(name: str) -> Family:
    """Return the family of an effect, with or without its place; ``Family.OWN`` for one that is not in the catalogue."""
    return _FAMILIES.get(name.partition(AT)[0], Family.OWN)


_FAMILIES = {effect.name: effect.family for effect in CATALOGUE}
