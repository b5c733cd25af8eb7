"""Rigs for asking what an effect would do: one effect alone along a known motion or signal, and a rig that can be pushed anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import sympy as sp

from rigsight.effects import Effect, Place, kind_of
from rigsight.parameters import Parameter
from rigsight.rigs import Drive, Joint, Rig, Sensor, Signal, force_symbol
from rigsight.rigs.mechanism import Coordinate, Mechanism
from rigsight.simulate import Structure, compose

STIFFNESS = "k"
_JOINT, _DRIVE, _SENT, _SHOWN = "joint", "drive", "sent", "shown"
_PUSH, _MOTION, _RATE = "push at ", "motion of ", "rate of "


def _real(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)


@cache
def _joint_alone() -> Rig:
    """A spring whose motion is prescribed; effects of a joint act on it."""
    x = Coordinate(_real("x"), _real("d(x)"), "1", prescribed_by="moved")
    mechanism = Mechanism(
        inputs=("moved",),
        coordinates=(x,),
        kinetic=sp.S.Zero,
        potential=sp.S.Zero,
        joints=(Joint(_JOINT, x.symbol, stiffness=_real(STIFFNESS), inertia=sp.S.One),),
        drives=(),
        sensors=(Sensor("force", force_symbol(_JOINT), "1"),),
        order=("force",),
    )
    stiffness = Parameter(STIFFNESS, "stiffness")
    return Rig("joint alone", "", (Signal("moved", "1", ""),), (), (stiffness,), mechanism)


@cache
def _signal_alone() -> Rig:
    """A drive and a sensor that pass on a signal; effects of either act on it."""
    z, signal = Coordinate(_real("z"), _real("d(z)"), "1"), _real("signal")
    mechanism = Mechanism(
        inputs=("signal",),
        coordinates=(z,),
        kinetic=z.rate**2 / 2,
        potential=sp.S.Zero,
        joints=(Joint(_JOINT, z.symbol, damping=sp.S.One),),
        drives=(Drive(_DRIVE, signal, _real(_DRIVE), z.symbol),),
        sensors=(Sensor(_SENT, _real(_DRIVE), "1"), Sensor(_SHOWN, signal, "1")),
        order=(_DRIVE, _SENT, _SHOWN),
    )
    return Rig("signal alone", "", (Signal("signal", "1", ""),), (), (), mechanism)


def alone(effect: Effect) -> tuple[Structure, int]:
    """Return the equations of an effect by itself, and the number of the output that shows what it makes of motion or signal.

    Parameters
    ----------
    effect
        At any place; without a delay of its own.
    """
    return _alone(_Same(effect))


class _Same:
    """Lets declarations, which hold dictionaries and so cannot be hashed, be keys of a cache by identity."""

    def __init__(self, effect: Effect) -> None:
        self.effect = effect

    def __hash__(self) -> int:
        return id(self.effect)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.effect is other.effect


@cache
def _alone(same: _Same) -> tuple[Structure, int]:
    effect = replace(same.effect, name=kind_of(same.effect.name), at=None)
    if effect.place is Place.ACTUATOR:
        return compose(_signal_alone(), (replace(effect, at=_DRIVE),)), 0
    if effect.place is Place.SENSOR:
        return compose(_signal_alone(), (replace(effect, at=_SHOWN),)), 1
    return compose(_joint_alone(), (replace(effect, at=_JOINT),)), 0


def with_probes(rig: Rig) -> Rig:
    """Return a rig with an input more at every joint, drive and sensor, and outputs that show every joint's motion and drive's signal.

    The inputs are called by `push`; the motion of a joint, its rate and the signal of a drive are the outputs behind the rig's own,
    in the order joint by joint, then drive by drive (see `motion_outputs`, `signal_outputs`).
    """
    mechanism = rig.mechanism
    pushed = [*(joint.name for joint in mechanism.joints), *(drive.name for drive in mechanism.drives)]
    pushed += [sensor.name for sensor in mechanism.sensors]
    inputs = tuple(map(push, pushed))
    pushes = tuple(
        Drive(
            f"{_PUSH}joint {joint.name}",
            _real(push(joint.name)),
            _real(f"{_PUSH}joint {joint.name}"),
            joint.motion,
        )
        for joint in mechanism.joints
    )
    drives = tuple(
        replace(drive, signal=drive.signal + _real(push(drive.name))) for drive in mechanism.drives
    )
    sensors = tuple(
        replace(sensor, reads=sensor.reads + _real(push(sensor.name))) for sensor in mechanism.sensors
    )
    shown = [
        sensor
        for joint in mechanism.joints
        for sensor in (
            Sensor(f"{_MOTION}{joint.name}", joint.motion - joint.rest, ""),
            Sensor(f"{_RATE}{joint.name}", mechanism.rate(joint.motion), ""),
        )
    ]
    shown += [Sensor(f"{_SENT}{drive.name}", _real(drive.name), "") for drive in mechanism.drives]
    order = (*(drive.name for drive in pushes), *mechanism.order, *(sensor.name for sensor in shown))
    return replace(
        rig,
        name=f"{rig.name} with probes",
        inputs=(*rig.inputs, *(Signal(name, "", "") for name in inputs)),
        mechanism=replace(
            mechanism,
            inputs=(*mechanism.inputs, *inputs),
            drives=(*drives, *pushes),
            sensors=(*sensors, *shown),
            order=order,
        ),
    )


def push(place: str) -> str:
    """Return the name of the input that pushes at a place."""
    return f"{_PUSH}{place}"


def motion_columns(rig: Rig, joints: Sequence[str]) -> dict[str, int]:
    """Return the number of the output, of the rig with probes, that shows the motion of each joint; its rate is the next one."""
    first = len(rig.mechanism.sensors)
    names = [joint.name for joint in rig.mechanism.joints]
    return {name: first + 2 * names.index(name) for name in joints}


def signal_columns(rig: Rig) -> dict[str, int]:
    """Return the number of the output, of the rig with probes, that shows the signal of each drive."""
    first = len(rig.mechanism.sensors) + 2 * len(rig.mechanism.joints)
    return {drive.name: first + i for i, drive in enumerate(rig.mechanism.drives)}
