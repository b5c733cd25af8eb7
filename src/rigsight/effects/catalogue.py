"""The effects that a diagnosis can name, one explicit tuple."""

from __future__ import annotations

from collections.abc import Iterable

from rigsight.effects.actuator_lag import ACTUATOR_LAG
from rigsight.effects.asymmetric_stiffness import ASYMMETRIC_STIFFNESS
from rigsight.effects.back_driving_friction import BACK_DRIVING_FRICTION
from rigsight.effects.backlash import BACKLASH
from rigsight.effects.bouc_wen_hysteresis import BOUC_WEN_HYSTERESIS
from rigsight.effects.coasting_bridge import COASTING_BRIDGE
from rigsight.effects.command_delay import COMMAND_DELAY
from rigsight.effects.command_filter import COMMAND_FILTER
from rigsight.effects.command_rate_limit import COMMAND_RATE_LIMIT
from rigsight.effects.conicity_variation import CONICITY_VARIATION
from rigsight.effects.controller_dead_band import CONTROLLER_DEAD_BAND
from rigsight.effects.controller_saturation import CONTROLLER_SATURATION
from rigsight.effects.coulomb_friction import COULOMB_FRICTION
from rigsight.effects.creep_saturation import CREEP_SATURATION
from rigsight.effects.cubic_stiffness import CUBIC_STIFFNESS
from rigsight.effects.derivative_action import DERIVATIVE_ACTION
from rigsight.effects.directional_damping import DIRECTIONAL_DAMPING
from rigsight.effects.directional_friction import DIRECTIONAL_FRICTION
from rigsight.effects.effect import Effect, Family
from rigsight.effects.encoder_eccentricity import ENCODER_ECCENTRICITY
from rigsight.effects.end_stop import END_STOP
from rigsight.effects.flexible_gear import FLEXIBLE_GEAR
from rigsight.effects.flexible_mode import FLEXIBLE_MODE
from rigsight.effects.free_play import FREE_PLAY
from rigsight.effects.friction_compensation import FRICTION_COMPENSATION
from rigsight.effects.gravity_pendulum import GRAVITY_PENDULUM
from rigsight.effects.gravity_torque import GRAVITY_TORQUE
from rigsight.effects.inertia import INERTIA
from rigsight.effects.input_dead_zone import INPUT_DEAD_ZONE
from rigsight.effects.input_delay import INPUT_DELAY
from rigsight.effects.input_saturation import INPUT_SATURATION
from rigsight.effects.integral_action import INTEGRAL_ACTION
from rigsight.effects.iwan_hysteresis import IWAN_HYSTERESIS
from rigsight.effects.load_dependent_friction import LOAD_DEPENDENT_FRICTION
from rigsight.effects.load_dependent_stribeck_friction import LOAD_DEPENDENT_STRIBECK_FRICTION
from rigsight.effects.lugre_friction import LUGRE_FRICTION
from rigsight.effects.maxwell_branch import MAXWELL_BRANCH
from rigsight.effects.periodic_disturbance import PERIODIC_DISTURBANCE
from rigsight.effects.pid_action import PID_ACTION
from rigsight.effects.placed import AT, placed
from rigsight.effects.position_dependent_damping import POSITION_DEPENDENT_DAMPING
from rigsight.effects.power_law_stiffness import POWER_LAW_STIFFNESS
from rigsight.effects.presliding_friction import PRESLIDING_FRICTION
from rigsight.effects.quadratic_damping import QUADRATIC_DAMPING
from rigsight.effects.rectified_sensor import RECTIFIED_SENSOR
from rigsight.effects.sensor_delay import SENSOR_DELAY
from rigsight.effects.sensor_lag import SENSOR_LAG
from rigsight.effects.speed_limit import SPEED_LIMIT
from rigsight.effects.speed_loop_integral import SPEED_LOOP_INTEGRAL
from rigsight.effects.stribeck_friction import STRIBECK_FRICTION
from rigsight.effects.time_shift import TIME_SHIFT
from rigsight.effects.torque_ripple import TORQUE_RIPPLE
from rigsight.effects.velocity_feedforward import VELOCITY_FEEDFORWARD
from rigsight.errors import check_option

CATALOGUE: tuple[Effect, ...] = (
    BOUC_WEN_HYSTERESIS,
    IWAN_HYSTERESIS,
    MAXWELL_BRANCH,
    COULOMB_FRICTION,
    STRIBECK_FRICTION,
    DIRECTIONAL_FRICTION,
    LOAD_DEPENDENT_FRICTION,
    LOAD_DEPENDENT_STRIBECK_FRICTION,
    BACK_DRIVING_FRICTION,
    PRESLIDING_FRICTION,
    LUGRE_FRICTION,
    QUADRATIC_DAMPING,
    DIRECTIONAL_DAMPING,
    POSITION_DEPENDENT_DAMPING,
    CUBIC_STIFFNESS,
    POWER_LAW_STIFFNESS,
    GRAVITY_PENDULUM,
    GRAVITY_TORQUE,
    TORQUE_RIPPLE,
    END_STOP,
    FREE_PLAY,
    BACKLASH,
    ASYMMETRIC_STIFFNESS,
    FLEXIBLE_MODE,
    FLEXIBLE_GEAR,
    INERTIA,
    INPUT_DELAY,
    ACTUATOR_LAG,
    INPUT_SATURATION,
    SPEED_LIMIT,
    COASTING_BRIDGE,
    INPUT_DEAD_ZONE,
    INTEGRAL_ACTION,
    SPEED_LOOP_INTEGRAL,
    DERIVATIVE_ACTION,
    PID_ACTION,
    VELOCITY_FEEDFORWARD,
    FRICTION_COMPENSATION,
    CONTROLLER_DEAD_BAND,
    CONTROLLER_SATURATION,
    COMMAND_RATE_LIMIT,
    COMMAND_FILTER,
    COMMAND_DELAY,
    PERIODIC_DISTURBANCE,
    CREEP_SATURATION,
    CONICITY_VARIATION,
    SENSOR_DELAY,
    SENSOR_LAG,
    TIME_SHIFT,
    ENCODER_ECCENTRICITY,
    RECTIFIED_SENSOR,
)


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
