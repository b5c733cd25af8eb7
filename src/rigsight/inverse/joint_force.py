"""Force of an effect at a joint along a measured motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import Effect, Place, kind_of
from rigsight.effects import symbols as canonical
from rigsight.effects.placed import ByIdentity
from rigsight.identify.rig_equations import FUNCTIONS
from rigsight.inverse.measured_motion import RecordMotion, nearest_force, speed_at_rest
from rigsight.records import Record
from rigsight.rigs import Joint, Rig, evaluated
from rigsight.rigs.reading.rig_file import rig_of_tables
from rigsight.simulate import Structure, compose, simulate

Floats = NDArray[np.float64]

_ROUNDS = 60
"""Rounds in which friction and the load that it depends on settle; each shortens the difference by the friction coefficient."""
_SETTLED = 1e-9
"""Change of this force relative to its size at which it has settled."""
_ACCURACY = 1e-5
_ELEMENT: dict[str, Any] = {
    "name": "measured_joint",
    "summary": "A joint moves as it was measured.",
    "inputs": {"x": {"unit": "m"}},
    "parameters": {
        "k": {"unit": "N/m", "lower": -1e18},
        "x_off": {"unit": "m", "default": 0.0, "lower": -1e9},
        "m_j": {"unit": "kg", "default": 0.0, "lower": 0.0},
    },
    "coordinates": {"stroke": {"unit": "m", "prescribed_by": "x"}},
    "joints": {"joint": {"motion": "stroke", "stiffness": "k", "rest": "x_off", "inertia": "m_j"}},
    "sensors": {"force": {"reads": "force(joint)", "unit": "N"}},
}
"""A joint whose motion is prescribed: effects with a history are simulated on it."""


@dataclass(frozen=True, eq=False)
class JointMotion:
    """Motion of one joint along a record: from its rest `x`, velocity `v`, acceleration, and the joint's own numbers."""

    record: Record
    x: Floats
    v: Floats
    acceleration: Floats
    rest: float
    stiffness: float
    load: Floats
    driven: Floats

    @cached_property
    def directed(self) -> Floats:
        """The velocity; where it is noise, small and in the direction of the motion before, until the next one begins."""
        least = speed_at_rest(self.v)
        signs = np.sign(self.v)
        moving = np.flatnonzero(np.abs(self.v) >= least)
        for left, right in pairwise(moving):
            if right - left > 1:
                there = signs[left + 1 : right]
                turned = np.flatnonzero(there == signs[left])
                last = left + 1 + (int(turned[-1]) + 1 if turned.size else 0)
                signs[left + 1 : right] = signs[left]
                if signs[right] != signs[left]:
                    signs[last:right] = signs[right]
        if moving.size:
            signs[: moving[0]], signs[moving[-1] :] = signs[moving[0]], signs[moving[-1]]
        return np.asarray(signs * np.maximum(np.abs(self.v), 1e-12 * least))

    @cached_property
    def of_spring(self) -> Floats:
        """The force of its spring alone, simulated as effects with a history are."""
        return self.simulated(compose(_element()), {})

    def simulated(self, structure: Structure, own: Mapping[str, float]) -> Floats:
        """Return the force of the prescribed joint, from equilibrium at the first sample on, shape (n_samples,)."""
        signals = {"x": self.x + self.rest}
        record = Record(name=self.record.name, dt=self.record.dt, signals=signals, units={}, hold="foh")
        values = {"k": self.stiffness, "x_off": self.rest, "m_j": 0.0, **own}
        return simulate(structure, values, record, accuracy=_ACCURACY)["force"]


def joint_motion(motion: RecordMotion, joint: Joint, values: Mapping[str, float]) -> JointMotion:
    """Return the motion of a joint of a rig along a record.

    Parameters
    ----------
    motion
        Of the rig.
    joint
        One of its joints.
    values
        Constants and parameters of the rig by name.
    """
    equations, rig, record = motion.equations, motion.equations.rig, motion.record
    numbers = {**values, **record.constants}
    p = equations.parameters(values, record)
    places = equations.at_places(motion.z, motion.u, p)
    x, v = places[f"motion@{joint.name}"], places[f"rate@{joint.name}"]
    along = equations.slopes_along(motion.z, motion.u, p)[joint.name] if equations.n_coordinates else None
    still = {c.rate: sp.S.Zero for c in rig.mechanism.coordinates}
    own = joint.stiffness * (joint.motion - joint.rest) + joint.force.xreplace(still)
    driven = motion.along(rig.mechanism.driven_by(joint), values)
    load = driven + motion.along(rig.mechanism.resisted_by(joint) + own, values)
    if along is None:
        # Of a joint along the prescribed coordinates themselves.
        acceleration = np.gradient(v, record.dt)
        for i, c in enumerate(rig.mechanism.prescribed):
            if joint.motion == c.symbol:
                acceleration = motion.u[3 * i + 2]
    else:
        acceleration = np.einsum("ik,ik->k", along, motion.a)
        # With the drives as the motion requires them: the load of the recorded ones explains these by itself.
        missing = nearest_force(along, motion.residual(values))
        load, driven = motion.filtered(load + missing), motion.filtered(driven + missing)
    return JointMotion(
        record,
        x,
        v,
        acceleration,
        evaluated(joint.rest, numbers),
        evaluated(joint.stiffness, numbers),
        load,
        driven,
    )


def effect_force(effect: Effect, values: Mapping[str, float], motion: JointMotion) -> Floats:
    """Return what an effect resists a joint with, beyond what its spring does, shape (n_samples,).

    Parameters
    ----------
    effect
        Of dynamics or disturbance.
    values
        Its parameters by their own names.
    motion
        Of the joint.
    """
    if effect.place is Place.DISTURBANCE:
        return _periodic(effect, values, motion)
    if effect.states or (effect.deflection is None and effect.torque is None):
        return _simulated(effect, values, motion)
    if effect.deflection is not None:
        return motion.stiffness * (_along(effect.deflection, values, motion, 0.0) - motion.x)
    assert effect.torque is not None
    if not effect.reads(canonical.load):
        return _along(effect.torque, values, motion, 0.0)
    # A drive that overcomes friction loads the joint with it.
    force = np.zeros_like(motion.load)
    for _ in range(_ROUNDS):
        before, force = force, _along(effect.torque, values, motion, force)
        if np.max(np.abs(force - before)) <= _SETTLED * np.max(np.abs(force)):
            break
    return force


def _along(
    expression: sp.Expr, values: Mapping[str, float], motion: JointMotion, overcome: Floats | float
) -> Floats:
    """Return a law along a motion whose drives also overcome a force."""
    loads = motion.load + overcome, motion.driven + overcome
    signals = (motion.x, motion.directed, motion.x + motion.rest, motion.acceleration, *loads)
    found = _compiled(expression, tuple(values))(*signals, *values.values())
    return np.array(np.broadcast_to(found, motion.x.shape), dtype=np.float64)


@cache
def _compiled(expression: sp.Expr, names: tuple[str, ...]) -> Any:
    loads = canonical.load, canonical.driven
    signals = (canonical.x, canonical.v, canonical.position, canonical.acceleration, *loads)
    own = [sp.Symbol(name, real=True) for name in names]
    return sp.lambdify((*signals, *own), expression, [FUNCTIONS, "numpy"], cse=True)


def _periodic(effect: Effect, values: Mapping[str, float], motion: JointMotion) -> Floats:
    """Return the force of an effect of the time alone, whose phase is zero at the first sample of every record."""
    assert effect.torque is not None
    phases = {state.symbol: state.rate * canonical.t for state in effect.states}
    own = {sp.Symbol(name, real=True): value for name, value in values.items()}
    force = sp.lambdify(canonical.t, effect.torque.xreplace(phases).xreplace(own), "numpy")
    return np.asarray(force(motion.record.dt * np.arange(motion.record.n_samples)))


@cache
def _element() -> Rig:
    return rig_of_tables(_ELEMENT, "Measured joint", check_units=False)


@cache
def _unplaced(key: ByIdentity[Effect]) -> Effect:
    """Return an effect for the only joint of the element; equal arguments give the same object, compiled once."""
    return replace(key.value, name=kind_of(key.value.name), at=None)


def _simulated(effect: Effect, values: Mapping[str, float], motion: JointMotion) -> Floats:
    """Return the force of an effect with a history, from equilibrium at the first sample on."""
    alone = _unplaced(ByIdentity(effect))
    structure = compose(_element(), [alone])
    named = {structure.parameter_name(alone, name): value for name, value in values.items()}
    return motion.simulated(structure, named) - motion.of_spring
