"""Hidden effects of the trials of design ``handwritten``: eight kinds of trials in turn, twelve rows of each.

The kind changes fastest, so that the first N trials contain all kinds evenly. The order of the rows of a kind is shuffled by the
seed for each pass.
"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight_bench.trials.kinds import Kind
from rigsight_bench.trials.passes import shuffled


@dataclass(frozen=True)
class Cell:
    """What one trial hides.

    Attributes
    ----------
    kind
        A single effect, one from outside of the catalogue, none, or wrong parameters.
    rig
        Name of the built-in rig.
    effect
        Name of the effect; empty where there is none.
    place
        Where it acts: joint, drive or sensor by its name in the rig's file.
    """

    kind: Kind
    rig: str
    effect: str = ""
    place: str = ""


Rows = tuple[tuple[str, str, str], ...]

_AXIS: Rows = tuple(
    ("axis", effect, "dynamics")
    for effect in (
        "coulomb_friction", "bouc_wen_hysteresis", "cubic_stiffness", "stribeck_friction", "backlash", "power_law_stiffness",
        "presliding_friction", "free_play", "asymmetric_stiffness", "iwan_hysteresis", "end_stop", "maxwell_branch",
    )
)  # fmt: skip
_DRIVE_TRAIN: Rows = (
    ("drive_train", "backlash", "shaft"), ("drive_train", "coulomb_friction", "load_bearing"),
    ("drive_train", "stribeck_friction", "motor_bearing"), ("drive_train", "cubic_stiffness", "shaft"),
    ("drive_train", "torque_ripple", "motor_bearing"), ("drive_train", "free_play", "shaft"),
    ("drive_train", "quadratic_damping", "load_bearing"), ("drive_train", "presliding_friction", "load_bearing"),
    ("drive_train", "bouc_wen_hysteresis", "shaft"), ("drive_train", "directional_friction", "motor_bearing"),
    ("drive_train", "flexible_mode", "load_bearing"), ("drive_train", "maxwell_branch", "shaft"),
)  # fmt: skip
_ELEMENT: Rows = tuple(
    ("element", effect, "dynamics")
    for effect in (
        "bouc_wen_hysteresis", "coulomb_friction", "inertia", "cubic_stiffness", "maxwell_branch", "presliding_friction",
        "quadratic_damping", "backlash", "stribeck_friction", "iwan_hysteresis", "free_play", "position_dependent_damping",
    )
)  # fmt: skip
_ARM: Rows = (
    ("two_link_arm", "coulomb_friction", "shoulder"), ("two_link_arm", "quadratic_damping", "elbow"),
    ("two_link_arm", "torque_ripple", "elbow"), ("two_link_arm", "stribeck_friction", "elbow"),
    ("two_link_arm", "end_stop", "elbow"), ("two_link_arm", "presliding_friction", "shoulder"),
    ("two_link_arm", "maxwell_branch", "elbow"), ("two_link_arm", "coulomb_friction", "elbow"),
    ("two_link_arm", "quadratic_damping", "shoulder"), ("two_link_arm", "torque_ripple", "shoulder"),
    ("two_link_arm", "flexible_mode", "elbow"), ("two_link_arm", "stribeck_friction", "shoulder"),
)  # fmt: skip
_DRIVES_AND_SENSORS: Rows = (
    ("axis", "input_delay", "actuator"), ("drive_train", "sensor_delay", "load_angle"),
    ("running_gear", "input_saturation", "actuator"), ("two_link_arm", "actuator_lag", "shoulder_motor"),
    ("drive_train", "speed_limit", "motor"), ("axis", "input_dead_zone", "actuator"),
    ("running_gear", "sensor_lag", "sensor"), ("axis", "input_saturation", "actuator"),
    ("two_link_arm", "input_delay", "elbow_motor"), ("drive_train", "input_dead_zone", "motor"),
    ("axis", "actuator_lag", "actuator"), ("two_link_arm", "sensor_lag", "angle_2"),
)  # fmt: skip
_RUNNING_GEAR: Rows = (
    *(
        ("running_gear", effect, "yaw_dynamics")
        for effect in (
            "bouc_wen_hysteresis", "stribeck_friction", "free_play", "quadratic_damping", "iwan_hysteresis", "coulomb_friction",
            "end_stop", "backlash", "asymmetric_stiffness", "flexible_mode", "cubic_stiffness",
        )
    ),
    ("running_gear", "creep_saturation", "lateral_dynamics"),
)  # fmt: skip
_OUTSIDE: Rows = (
    ("axis", "exponential_spring", "dynamics"), ("drive_train", "meshing_friction", "motor_bearing"),
    ("running_gear", "rate_limit", "actuator"), ("element", "power_damping", "dynamics"),
    ("drive_train", "breathing_crack", "shaft"), ("axis", "rate_limit", "actuator"),
    ("two_link_arm", "meshing_friction", "shoulder"), ("running_gear", "exponential_spring", "yaw_dynamics"),
    ("axis", "power_damping", "dynamics"), ("element", "breathing_crack", "dynamics"),
    ("drive_train", "power_damping", "load_bearing"), ("element", "exponential_spring", "dynamics"),
)  # fmt: skip
_CONTROLS: tuple[tuple[Kind, str], ...] = (
    ("none", "axis"), ("parameters", "drive_train"), ("none", "running_gear"), ("parameters", "two_link_arm"),
    ("none", "element"), ("parameters", "axis"), ("none", "drive_train"), ("parameters", "running_gear"),
    ("none", "two_link_arm"), ("parameters", "element"), ("none", "axis"), ("parameters", "drive_train"),
)  # fmt: skip


def _singles(rows: Rows) -> tuple[Cell, ...]:
    return tuple(Cell("single", *row) for row in rows)


TURNS: tuple[tuple[Cell, ...], ...] = (
    _singles(_AXIS),
    _singles(_DRIVE_TRAIN),
    tuple(Cell(kind, rig) for kind, rig in _CONTROLS),
    _singles(_ELEMENT),
    _singles(_ARM),
    _singles(_DRIVES_AND_SENSORS),
    _singles(_RUNNING_GEAR),
    tuple(Cell("outside", *row) for row in _OUTSIDE),
)
"""Twelve cells of each kind of trial, in the order in which the kinds come: one trial of eight is a control, one from outside."""


def handwritten_cells() -> tuple[Cell, ...]:
    """Return all cells of one pass."""
    return tuple(cell for cells in TURNS for cell in cells)


def handwritten_cell_of(seed: int, trial: int) -> Cell:
    """Return what a trial hides; every pass over the cells of a kind is shuffled anew."""
    turn, number = divmod(trial, len(TURNS))
    return shuffled(TURNS[number], turn, seed, number)
