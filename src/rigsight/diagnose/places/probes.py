"""Rigs that tell what an effect would do: an effect alone along a known motion or signal, and a rig with a push at each place."""

from __future__ import annotations

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
_PUSH, _MOTION = "push at ", "motion of "
PUSH_SIZE = "push_size"


def _real(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)


@cache
def _joint_alone() -> Rig:
    """Return a spring whose motion is prescribed; effects of a joint act on it."""
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
    """Return a drive and a sensor that pass on a signal; effects of either act on it."""
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
        At any place; without a delay.
    """
    name = kind_of(effect.name)
    law = (effect.torque, effect.spring, effect.deflection, effect.drive, effect.measured, effect.states)
    if name not in _known or _known[name][0] != law:
        _known[name] = (law, _composed(replace(effect, name=name, at=None)))
    return _known[name][1]


_known: dict[str, tuple[tuple[object, ...], tuple[Structure, int]]] = {}
"""By name; a user's own effect may change while a notebook runs."""


def _composed(effect: Effect) -> tuple[Structure, int]:
    if effect.place is Place.ACTUATOR:
        return compose(_signal_alone(), (replace(effect, at=_DRIVE),)), 0
    if effect.place is Place.SENSOR:
        return compose(_signal_alone(), (replace(effect, at=_SHOWN),)), 1
    return compose(_joint_alone(), (replace(effect, at=_JOINT),)), 0


def with_probes(rig: Rig) -> Rig:
    """Return a rig with a push at every joint, drive and sensor.

    Each push is an input (see `push`), and all of them are in units of the parameter `PUSH_SIZE`. Behind the rig's own outputs
    stand the motion of each joint (see `motion_columns`) and the signal of each drive (see `signal_columns`).
    """
    mechanism, size = rig.mechanism, _real(PUSH_SIZE)
    pushed = [*(joint.name for joint in mechanism.joints), *(drive.name for drive in mechanism.drives)]
    pushed += [sensor.name for sensor in mechanism.sensors]
    inputs = tuple(map(push, pushed))
    pushes = tuple(
        Drive(
            f"{_PUSH}joint {joint.name}",
            _real(push(joint.name)),
            size * _real(f"{_PUSH}joint {joint.name}"),
            joint.motion,
        )
        for joint in mechanism.joints
    )
    drives = tuple(
        replace(drive, signal=drive.signal + size * _real(push(drive.name))) for drive in mechanism.drives
    )
    sensors = tuple(
        replace(sensor, reads=sensor.reads + size * _real(push(sensor.name))) for sensor in mechanism.sensors
    )
    shown = [Sensor(f"{_MOTION}{joint.name}", joint.motion - joint.rest, "") for joint in mechanism.joints]
    shown += [Sensor(f"{_SENT}{drive.name}", _real(drive.name), "") for drive in mechanism.drives]
    order = (*(drive.name for drive in pushes), *mechanism.order, *(sensor.name for sensor in shown))
    return replace(
        rig,
        name=f"{rig.name} with probes",
        inputs=(*rig.inputs, *(Signal(name, "", "") for name in inputs)),
        parameters=(*rig.parameters, Parameter(PUSH_SIZE, "size of the push")),
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


def motion_columns(rig: Rig) -> dict[str, int]:
    """Return the number of the output, of the rig with probes, that shows the motion of each joint."""
    first = len(rig.mechanism.sensors)
    return {joint.name: first + i for i, joint in enumerate(rig.mechanism.joints)}


def signal_columns(rig: Rig) -> dict[str, int]:
    """Return the number of the output, of the rig with probes, that shows the signal of each drive."""
    first = len(rig.mechanism.sensors) + len(rig.mechanism.joints)
    return {drive.name: first + i for i, drive in enumerate(rig.mechanism.drives)}
