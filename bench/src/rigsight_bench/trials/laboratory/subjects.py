"""Hidden effects of the trials of design ``laboratory``: ten conditions in turn, each on several test stands.

The condition changes fastest, so that the first N trials contain all conditions evenly. The order of stands and families of
effects is shuffled by the seed for each pass.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np

from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import Effect, Place, kind_of
from rigsight.rigs import joint_of
from rigsight_bench.trials.counted import counted_effects
from rigsight_bench.trials.laboratory.stands import STANDS, Stand
from rigsight_bench.trials.passes import shuffled

Item = TypeVar("Item")

Condition = Literal[
    "clean", "antialias_filter", "feedback", "repeats", "stiction", "encoder", "free_decay", "drift", "offsets",
    "three_effects",
]  # fmt: skip
Family = Literal["friction", "damping", "spring", "mass", "pulsation", "drive", "sensor", "rolling"]

FAMILIES: dict[Family, frozenset[str]] = {
    "friction": frozenset({
        "coulomb_friction", "stribeck_friction", "presliding_friction", "directional_friction", "load_dependent_friction",
    }),
    "damping": frozenset({"quadratic_damping", "position_dependent_damping"}),
    "spring": frozenset({
        "bouc_wen_hysteresis", "iwan_hysteresis", "maxwell_branch", "cubic_stiffness", "power_law_stiffness",
        "asymmetric_stiffness", "free_play", "backlash", "end_stop",
    }),
    "mass": frozenset({"flexible_mode", "inertia"}),
    "pulsation": frozenset({"torque_ripple", "periodic_disturbance"}),
    "drive": frozenset({"input_delay", "actuator_lag", "input_saturation", "speed_limit", "input_dead_zone"}),
    "sensor": frozenset({"sensor_delay", "sensor_lag", "time_shift", "encoder_eccentricity"}),
    "rolling": frozenset({"creep_saturation", "conicity_variation"}),
}  # fmt: skip
"""Effects that are rivals of one another; together with `NEVER` those that were counted, and no later ones."""
NEVER = frozenset({"gravity_pendulum"})
"""It needs a swing of a radian, which no stand makes; the standard design has it."""
_LATE = frozenset({"sensor_delay", "sensor_lag", "time_shift"})

_CELLS: dict[Condition, tuple[tuple[str, tuple[Family, ...]], ...]] = {
    "clean": (
        ("stage", ("spring",)), ("joint", ("friction",)), ("drive_train", ("drive",)),
        ("running_gear", ("rolling",)), ("element", ("damping",)), ("stage", ("mass",)),
    ),
    "antialias_filter": (
        ("stage", ("drive",)), ("joint", ("friction",)), ("drive_train", ("spring",)),
        ("running_gear", ("spring",)), ("element", ("friction",)), ("stage", ("pulsation",)),
    ),
    "feedback": (
        ("stage", ("spring",)), ("joint", ("friction",)), ("joint", ("drive",)),
        ("drive_train", ("friction",)), ("drive_train", ("drive",)), ("running_gear", ("damping",)),
    ),
    "repeats": (
        ("stage", ("friction",)), ("joint", ("damping",)), ("drive_train", ("friction",)),
        ("running_gear", ("drive",)), ("element", ("spring",)), ("stage", ("spring",)),
    ),
    "stiction": (
        ("stage", ("friction",)), ("joint", ("friction",)), ("joint", ("friction",)),
        ("drive_train", ("friction",)), ("running_gear", ("friction",)), ("element", ("friction",)),
    ),
    "encoder": (
        ("stage", ("drive",)), ("joint", ("friction",)), ("drive_train", ("sensor",)),
        ("running_gear", ("spring",)), ("drive_train", ("friction",)), ("joint", ("pulsation",)),
    ),
    "free_decay": (
        ("stage", ("friction",)), ("stage", ("damping",)), ("drive_train", ("friction",)),
        ("arm", ("friction",)), ("arm", ("damping",)), ("running_gear", ("spring",)),
    ),
    "drift": (
        ("stage", ("spring",)), ("joint", ("friction",)), ("drive_train", ("friction",)),
        ("running_gear", ("rolling",)), ("element", ("mass",)), ("stage", ("drive",)),
    ),
    "offsets": (
        ("stage", ("drive",)), ("stage", ("spring",)), ("drive_train", ("damping",)),
        ("running_gear", ("sensor",)), ("element", ("friction",)), ("arm", ("friction",)),
    ),
    "three_effects": (
        ("stage", ("spring", "friction", "drive")), ("stage", ("damping", "mass", "drive")),
        ("joint", ("friction", "drive", "pulsation")), ("drive_train", ("friction", "spring", "drive")),
        ("running_gear", ("rolling", "friction", "drive")), ("element", ("friction", "spring", "damping")),
    ),
}  # fmt: skip
"""Six of each condition: test stand, and the family of each effect that is hidden."""
CONDITIONS: tuple[Condition, ...] = tuple(_CELLS)


@dataclass(frozen=True)
class LaboratorySubject:
    """What one trial hides.

    Attributes
    ----------
    condition
        What the laboratory does to the records.
    stand
        Name of the test stand.
    families
        Of each hidden effect.
    """

    condition: Condition
    stand: str
    families: tuple[Family, ...]


def laboratory_cells() -> tuple[LaboratorySubject, ...]:
    """Return all cells of one pass."""
    return tuple(
        LaboratorySubject(condition, stand, families)
        for condition, rows in _CELLS.items()
        for stand, families in rows
    )


def laboratory_subject_of(seed: int, trial: int) -> LaboratorySubject:
    """Return what a trial hides; every pass over the cells of a condition is shuffled anew."""
    turn, number = divmod(trial, len(CONDITIONS))
    condition = CONDITIONS[number]
    return LaboratorySubject(condition, *shuffled(_CELLS[condition], turn, seed, number))


def draw_laboratory_effects(subject: LaboratorySubject, rng: np.random.Generator) -> tuple[Effect, ...]:
    """Draw the effects of a trial, one of each family, each with its place; the first is the main one.

    The law is drawn first, then where it stands.

    Parameters
    ----------
    subject
        What is asked for.
    rng
        Source of randomness.
    """
    stand = STANDS[subject.stand]
    drawn = []
    for family in subject.families:
        shown = effects_shown(stand, family)
        law = _any_of(sorted({kind_of(effect.name) for effect in shown}), rng)
        drawn.append(_any_of([effect for effect in shown if kind_of(effect.name) == law], rng))
    return tuple(drawn[i] for i in rng.permutation(len(drawn)))


def effects_shown(stand: Stand, family: Family) -> list[Effect]:
    """Return the effects of a family that records of a stand can distinguish.

    Parameters
    ----------
    stand
        The test stand.
    family
        Family of effects.
    """
    offered = [e for e in candidates_on(stand.rig, counted_effects()) if kind_of(e.name) in FAMILIES[family]]
    return [effect for effect in offered if not _has_a_double(stand, effect)]


def _has_a_double(stand: Stand, effect: Effect) -> bool:
    """Return True for an effect that gives the same records as another effect, or as other parameter values."""
    rig, kind = stand.rig, kind_of(effect.name)
    if kind == "directional_friction":
        # It is dry friction beside a constant force, and that is free there.
        return bool(rig.constant_forces_at(joint_of(rig, effect)))
    # What the only sensor shows late, the drive does late.
    return kind in _LATE and rig.is_driven and effect.place is Place.SENSOR and len(rig.outputs) == 1


def _any_of(items: list[Item], rng: np.random.Generator) -> Item:
    return items[int(rng.integers(len(items)))]
