"""Where a known cause can be added to measured records, and in which signal it then shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import sympy as sp

from rigsight.effects import Effect, Place, family_of, placed
from rigsight.effects.symbols import derivative
from rigsight.inverse import hidden_effects
from rigsight.rigs import Drive, Joint, Rig, evaluated
from rigsight.rigs.parts import force_symbol
from rigsight_bench.trials.counted import counted_effects
from rigsight_bench.trials.measured.base import Base

Way = Literal["force_in_input", "force_in_reading", "input", "reading"]
"""A force at a joint that the drive overcomes or a sensor reads, what the drive does with its input, what a sensor reads."""
_IN_INPUT = ("input_delay", "input_dead_zone")
"""Effects of a drive that a change of the logged input makes exact: what a limit or a lag took away cannot be put back."""
_IN_READING = ("sensor_delay", "sensor_lag", "time_shift", "encoder_eccentricity")
DELAYS = ("input_delay", "sensor_delay", "time_shift")
"""Effects that move a signal by whole samples."""


@dataclass(frozen=True, eq=False)
class Spot:
    """An effect at a place of a measured rig.

    Attributes
    ----------
    effect
        As verdicts call it on this rig.
    place
        Joint, drive or sensor.
    way
        How the records change.
    signal
        The input or reading that changes.
    drive
        Name of the drive that overcomes a force; empty elsewhere.
    """

    effect: Effect
    place: str
    way: Way
    signal: str
    drive: str = ""


def spots(base: Base) -> tuple[Spot, ...]:
    """Return all effects that can be added to the records of a campaign and show in them, each at its places.

    Parameters
    ----------
    base
        Base equations of the campaign.
    """
    found = [spot for effect in counted_effects() for spot in _of_effect(base, effect)]
    hidden = hidden_effects(base.campaign, base.values, [spot.effect for spot in found])
    found = [spot for spot in found if spot.effect.name not in hidden]
    return tuple(spot for spot in found if not is_beside_own(base, spot) or base.without is not None)


def is_beside_own(base: Base, spot: Spot) -> bool:
    """Return True for an effect at a joint at which the base equations already have one of its family.

    Parameters
    ----------
    base
        Base equations of the campaign.
    spot
        Effect and place.
    """
    taken = {(family_of(effect.name), base.rig.acts_at(effect)) for effect in base.modelled}
    return (family_of(spot.effect.name), spot.place) in taken


def _of_effect(base: Base, effect: Effect) -> list[Spot]:
    rig = base.rig
    found = []
    for place in (
        rig.places(effect.place) if effect.place is not Place.DISTURBANCE else rig.places(Place.DYNAMICS)
    ):
        at = placed(effect, place)
        if not rig.offers(at) or at.reads_inertia:
            continue
        spot = _at(base, effect if rig.has_one_motion else at, place)
        if spot is not None:
            found.append(spot)
    return found


def _at(base: Base, effect: Effect, place: str) -> Spot | None:
    rig, records = base.rig, base.campaign.records
    kind, mechanism = effect.name.partition("@")[0], rig.mechanism
    if kind in DELAYS and len({record.dt for record in records}) > 1:
        return None
    if effect.place in (Place.DYNAMICS, Place.DISTURBANCE):
        return _at_joint(base, effect, place)
    if kind in _IN_INPUT:
        drive = next(drive for drive in mechanism.drives if drive.name == place)
        signal = _input_of(rig, drive)
        return None if signal is None else Spot(effect, place, "input", signal)
    if kind not in _IN_READING or any(place not in record for record in records):
        return None
    if kind != "time_shift" and not all(_input_of(rig, drive) for drive in mechanism.drives):
        # A control law of the rig reads its sensors as they are.
        return None
    # With one sensor, a late reading is a late drive.
    if kind == "sensor_delay" and rig.is_driven and len(rig.outputs) == 1:
        return None
    return Spot(effect, place, "reading", place)


def _at_joint(base: Base, effect: Effect, place: str) -> Spot | None:
    rig, records = base.rig, base.campaign.records
    mechanism = rig.mechanism
    joint = next(joint for joint in mechanism.joints if joint.name == place)
    springs = effect.spring is not None or effect.deflection is not None
    if springs and evaluated(joint.stiffness, {**base.values, **records[0].constants}) <= 0.0:
        return None
    if effect.holds_constant_force and rig.constant_forces_at(joint):
        # Friction that differs each way is friction beside a constant force.
        return None
    if effect.name.startswith("gravity") and _has_weight(rig, joint):
        return None
    if not rig.is_driven:
        plain = [s.name for s in mechanism.sensors if s.reads == force_symbol(place)]
        others = [s for s in mechanism.sensors if force_symbol(place) in s.reads.free_symbols]
        if len(plain) == len(others) == 1 and all(plain[0] in record for record in records):
            return Spot(effect, place, "force_in_reading", plain[0])
        return None
    for drive in mechanism.drives:
        signal = _input_of(rig, drive)
        if signal is not None and _is_along(rig, joint, drive):
            return Spot(effect, place, "force_in_input", signal, drive.name)
    return None


def _has_weight(rig: Rig, joint: Joint) -> bool:
    along = [c for c in rig.mechanism.coordinates if derivative(joint.motion, c.symbol) != 0]
    return any(derivative(rig.mechanism.potential, c.symbol) != 0 for c in along)


def _input_of(rig: Rig, drive: Drive) -> str | None:
    """Return the input that a drive is a constant multiple of, and that nothing else reads; None if there is none."""
    own = sp.Symbol(drive.name, real=True)
    name = next((s.name for s in rig.inputs if sp.Symbol(s.name, real=True) == drive.signal), None)
    gain = derivative(drive.force, own)
    numbers = {p.name for p in (*rig.constants, *rig.parameters)}
    if name is None or gain == 0 or not {s.name for s in gain.free_symbols} <= numbers:
        return None
    mechanism = rig.mechanism
    symbol = sp.Symbol(name, real=True)
    others: list[sp.Expr] = [part for d in mechanism.drives if d is not drive for part in (d.signal, d.force)]
    others += [drive.force, *mechanism.signals.values(), *(state.rate for state in mechanism.states)]
    others += [part for j in mechanism.joints for part in (j.force, j.stiffness, j.damping, j.rest)]
    others += [sensor.reads for sensor in mechanism.sensors]
    read = {s for part in others for s in sp.sympify(part).free_symbols}
    behind = {s for part in others if part is not drive.force for s in sp.sympify(part).free_symbols}
    prescribes = any(c.prescribed_by == name for c in mechanism.prescribed)
    return None if symbol in read or own in behind or prescribes else name


def _is_along(rig: Rig, joint: Joint, drive: Drive) -> bool:
    """Return True if a joint moves along the same degrees of freedom as a drive, in a constant or known proportion."""
    mine, its = (
        sp.Matrix([derivative(motion, c.symbol) for c in rig.mechanism.free])
        for motion in (joint.motion, drive.along)
    )
    crossed = [sp.simplify(mine[i] * its[j] - mine[j] * its[i]) for i in range(len(mine)) for j in range(i)]
    return any(mine) and any(its) and not any(crossed)
