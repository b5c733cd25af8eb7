"""Auxiliary rigs for the screening: an effect alone along a known motion, a rig with a push at each place."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import sympy as sp

from rigsight.effects import Effect, Place, kind_of
from rigsight.effects import symbols as canonical
from rigsight.parameters import Parameter
from rigsight.rigs import Drive, Joint, Rig, Sensor, Signal, force_symbol
from rigsight.rigs.mechanism import Mechanism
from rigsight.rigs.parts import Coordinate
from rigsight.simulate import Structure, compose

STIFFNESS = "k"
_JOINT, _DRIVE, _SENT, _SHOWN = "joint", "drive", "sent", "shown"
_CARRIED, _MOVED = "carried", "moved"
_PUSH, _MOTION, _LOAD, _ALONG = "push at ", "motion of ", "load of ", "way of "
PUSH_SIZE = "push_size"


def _real(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)


@cache
def _joint_alone(with_load: bool) -> Rig:
    """Return a spring whose motion is prescribed; effects of a joint act on it, with a load beside that of the spring."""
    x = Coordinate(_real("x"), _real("d(x)"), "1", prescribed_by=_MOVED)
    inputs = (_MOVED, _CARRIED) if with_load else (_MOVED,)
    carrier = Drive("carrier", _real(_CARRIED), _real("carrier"), x.symbol)
    mechanism = Mechanism(
        inputs=inputs,
        coordinates=(x,),
        kinetic=sp.S.Zero,
        potential=sp.S.Zero,
        joints=(Joint(_JOINT, x.symbol, stiffness=_real(STIFFNESS), inertia=sp.S.One),),
        drives=(carrier,) if with_load else (),
        sensors=(Sensor("force", force_symbol(_JOINT), "1"),),
        order=("carrier", "force") if with_load else ("force",),
    )
    stiffness = Parameter(STIFFNESS, "stiffness")
    signals = tuple(Signal(name, "1", "") for name in inputs)
    return Rig("joint alone", "", signals, (), (stiffness,), mechanism)


@cache
def _signal_alone(with_speed: bool) -> Rig:
    """Return a drive and a sensor that pass on a signal; effects of either act on it, the drive's along a known motion."""
    free, signal = Coordinate(_real("z"), _real("d(z)"), "1"), _real("signal")
    way = Coordinate(_real("x"), _real("d(x)"), "1", prescribed_by=_MOVED)
    inputs = ("signal", _MOVED) if with_speed else ("signal",)
    along = way.symbol if with_speed else free.symbol
    mechanism = Mechanism(
        inputs=inputs,
        coordinates=(free, way) if with_speed else (free,),
        kinetic=free.rate**2 / 2,
        potential=sp.S.Zero,
        joints=(Joint(_JOINT, free.symbol, damping=sp.S.One),),
        drives=(Drive(_DRIVE, signal, _real(_DRIVE), along),),
        sensors=(Sensor(_SENT, _real(_DRIVE), "1"), Sensor(_SHOWN, signal, "1")),
        order=(_DRIVE, _SENT, _SHOWN),
    )
    return Rig("signal alone", "", tuple(Signal(name, "1", "") for name in inputs), (), (), mechanism)


def alone(effect: Effect) -> tuple[Structure, int]:
    """Return the equations of an effect by itself, and the number of the output that shows what it makes of motion or signal."""
    name = kind_of(effect.name)
    law = (effect.torque, effect.spring, effect.deflection, effect.drive, effect.measured, effect.states)
    if name not in _known or _known[name][0] != law:
        _known[name] = (law, _composed(replace(effect, name=name, at=None)))
    return _known[name][1]


_known: dict[str, tuple[tuple[object, ...], tuple[Structure, int]]] = {}
"""By name; a user's own effect may change while a notebook runs."""


def _composed(effect: Effect) -> tuple[Structure, int]:
    if effect.place is Place.ACTUATOR:
        return compose(_signal_alone(effect.reads(canonical.v)), (replace(effect, at=_DRIVE),)), 0
    if effect.place is Place.SENSOR:
        return compose(_signal_alone(False), (replace(effect, at=_SHOWN),)), 1
    return compose(_joint_alone(sees_load(effect)), (replace(effect, at=_JOINT, turns_freely=False),)), 0


def sees_load(effect: Effect) -> bool:
    """Return True for an effect that reads what loads its joint; what drives push alone is taken for all of it here."""
    return effect.reads(canonical.load) or effect.reads(canonical.driven)


def with_probes(rig: Rig) -> Rig:
    """Return a rig with a push at every joint, drive and sensor."""
    # Each push is an input (see `push`), and all of them are in units of the parameter `PUSH_SIZE`. Behind the rig's own outputs
    # stand the motion of each joint and what others load it with (see `motion_columns`, `load_columns`), the signal of each drive
    # and the way along which it pushes (see `signal_columns`, `way_columns`), and output, error and command of each controller
    # (see `controller_columns`).
    mechanism, size = rig.mechanism, _real(PUSH_SIZE)
    pushed = [*(joint.name for joint in mechanism.joints), *(drive.name for drive in mechanism.drives)]
    pushed += [sensor.name for sensor in mechanism.sensors]
    inputs = tuple(map(push, pushed))
    # In the joint's own force, so that a sensor which reads that force shows the push.
    joints = tuple(
        replace(joint, force=joint.force - size * _real(push(joint.name))) for joint in mechanism.joints
    )
    drives = tuple(
        replace(drive, signal=drive.signal + size * _real(push(drive.name))) for drive in mechanism.drives
    )
    sensors = tuple(
        replace(sensor, reads=sensor.reads + size * _real(push(sensor.name))) for sensor in mechanism.sensors
    )
    shown = [Sensor(f"{_MOTION}{joint.name}", joint.motion - joint.rest, "") for joint in mechanism.joints]
    shown += [Sensor(f"{_LOAD}{joint.name}", mechanism.carried_by(joint), "") for joint in mechanism.joints]
    shown += [Sensor(f"{_SENT}{drive.name}", _real(drive.name), "") for drive in mechanism.drives]
    shown += [Sensor(f"{_ALONG}{drive.name}", drive.along, "") for drive in mechanism.drives]
    for name, law in rig.controllers.items():
        parts = {"output": law.output, "error": law.error, "command": law.command}
        shown += [Sensor(f"{part} of {name}", expression, "") for part, expression in parts.items()]
    order = (*mechanism.order, *(sensor.name for sensor in shown))
    return replace(
        rig,
        name=f"{rig.name} with probes",
        inputs=(*rig.inputs, *(Signal(name, "", "") for name in inputs)),
        parameters=(*rig.parameters, Parameter(PUSH_SIZE, "size of the push")),
        mechanism=replace(
            mechanism,
            inputs=(*mechanism.inputs, *inputs),
            joints=joints,
            drives=drives,
            sensors=(*sensors, *shown),
            order=order,
        ),
    )


def push(place: str) -> str:
    """Return the name of the input that pushes at a place."""
    return f"{_PUSH}{place}"


def motion_columns(rig: Rig) -> dict[str, int]:
    """Return the number of the output, of the rig with probes, that shows the motion of each joint."""
    return _columns(len(rig.mechanism.sensors), rig.mechanism.joints)


def load_columns(rig: Rig) -> dict[str, int]:
    """Return the number of the output that shows what loads each joint beside its own spring."""
    return _columns(len(rig.mechanism.sensors) + len(rig.mechanism.joints), rig.mechanism.joints)


def signal_columns(rig: Rig) -> dict[str, int]:
    """Return the number of the output, of the rig with probes, that shows the signal of each drive."""
    return _columns(len(rig.mechanism.sensors) + 2 * len(rig.mechanism.joints), rig.mechanism.drives)


def way_columns(rig: Rig) -> dict[str, int]:
    """Return the number of the output that shows the way along which each drive pushes."""
    mechanism = rig.mechanism
    first = len(mechanism.sensors) + 2 * len(mechanism.joints) + len(mechanism.drives)
    return _columns(first, mechanism.drives)


def controller_columns(rig: Rig) -> dict[str, tuple[int, int, int]]:
    """Return the numbers of the outputs that show output, error and command of each controller, by the name of its drive."""
    mechanism = rig.mechanism
    first = len(mechanism.sensors) + 2 * len(mechanism.joints) + 2 * len(mechanism.drives)
    return {
        name: (at, at + 1, at + 2)
        for name, at in zip(rig.controllers, itertools.count(first, 3), strict=False)
    }


def _columns(first: int, places: Sequence[Joint | Drive]) -> dict[str, int]:
    return {place.name: first + i for i, place in enumerate(places)}
