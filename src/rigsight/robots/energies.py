"""Kinetic and potential energy of a tree of bodies, in named steps from body to body.

Angular velocity, velocity and direction of gravity are carried outward along the tree, each in the frame of its body.

R. Featherstone, *Rigid Body Dynamics Algorithms* (Springer 2008), chapters 3 and 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import sympy as sp

from rigsight.records.record import Floats
from rigsight.robots.tables import DeclaredNumbers, Field
from rigsight.robots.tree import TreeBody, TreeJoint
from rigsight.simulate.equations.straight_line import needed_steps

AXES = "xyz"


@dataclass(frozen=True)
class _Frame:
    """Where a body is carried to: all in its own frame."""

    # Angular velocity, and velocity of its origin.
    turning: sp.Matrix
    moving: sp.Matrix
    up: sp.Matrix  # against gravity, times its acceleration
    lift: sp.Expr  # potential energy of its origin per mass

    @property
    def is_still(self) -> bool:
        """True where no joint is between it and the world."""
        return bool(self.turning.is_zero_matrix and self.moving.is_zero_matrix)

    def shifted(self, by: sp.Matrix) -> _Frame:
        return replace(
            self, moving=self.moving + self.turning.cross(by), lift=self.lift + (self.up.T * by)[0, 0]
        )

    def turned(self, rotation: sp.Matrix) -> _Frame:
        back = rotation.T
        return _Frame(back * self.turning, back * self.moving, back * self.up, self.lift)


@dataclass
class Energies:
    """The energies, and the signals that they are made of."""

    # One term for each body.
    kinetic: list[sp.Expr] = field(default_factory=list)
    potential: list[sp.Expr] = field(default_factory=list)
    # Name -> expression, each behind those that it reads.
    signals: dict[str, sp.Expr] = field(default_factory=dict)


def energies_of(
    bodies: Sequence[TreeBody],
    names: Sequence[str],
    coordinates: Sequence[sp.Symbol],
    gravity: Floats,
    numbers: DeclaredNumbers,
    held: frozenset[sp.Symbol] = frozenset(),
) -> Energies:
    """Return the energies of a tree, in which coordinates that are `held` are constants."""
    found = Energies()
    up = [
        numbers.constant(f"gravity_{axis}", -float(value), "m/s^2", f"gravity against {axis} of the world")
        for axis, value in zip(AXES, gravity, strict=True)
    ]
    frames = {0: _Frame(sp.zeros(3, 1), sp.zeros(3, 1), sp.Matrix(up), sp.S.Zero)}
    for body, name in zip(bodies, names, strict=True):
        known = _Known(name, numbers)
        frame = frames[body.parent]
        # Where a tree begins changes no energy but by a constant.
        if not frame.is_still:
            about = "position of its attachment to its parent"
            frame = frame.shifted(known.length("at", body.position, about))
        frame = frame.turned(sp.Matrix(3, 3, lambda i, j, turn=body.rotation: _number(float(turn[i, j]))))
        together = _together(body.joints)
        for i, alike in enumerate(together):
            called = f"joint{i + 1 if len(together) > 1 else ''}"
            own = [coordinates[joint.index] for joint in alike]
            frame = _moved(frame, alike, own, held, known, called)
        if body.joints:
            frame = _named(frame, name, found.signals)
        frames[body.index] = frame
        _add(found, body, frame, known)
    # The signals alone that the energies are made of.
    signals = {sp.Symbol(name, real=True): signal for name, signal in found.signals.items()}
    read = needed_steps([*found.kinetic, *found.potential], signals)
    return replace(found, signals={symbol.name: signal for symbol, signal in read.items()})


@dataclass(frozen=True)
class _Known:
    """Declares the numbers of one body."""

    body: str
    numbers: DeclaredNumbers

    def length(self, what: str, values: Floats, about: str) -> sp.Matrix:
        return sp.Matrix(
            [
                self.numbers.constant(
                    f"{self.body}_{what}_{axis}", float(value), "m", f"{self.body}: {about}, along {axis}"
                )
                for axis, value in zip(AXES, values, strict=True)
            ]
        )


def _together(joints: Sequence[TreeJoint]) -> list[list[TreeJoint]]:
    """Return the joints of a body in their order, those that follow one another about one axis together: their angles add up."""
    groups: list[list[TreeJoint]] = []
    for joint in joints:
        last = groups[-1][-1] if groups else None
        if (
            last is not None
            and last.slides == joint.slides
            and np.array_equal(last.axis, joint.axis)
            and np.array_equal(last.anchor, joint.anchor)
        ):
            groups[-1].append(joint)
        else:
            groups.append([joint])
    return groups


def _moved(
    frame: _Frame,
    joints: Sequence[TreeJoint],
    coordinates: Sequence[sp.Symbol],
    held: frozenset[sp.Symbol],
    known: _Known,
    called: str,
) -> _Frame:
    first = joints[0]
    axis = sp.Matrix([_number(value) for value in first.axis])
    rate = sp.Add(*(sp.Symbol(f"d({q.name})", real=True) for q in coordinates if q not in held))
    unit = "m" if first.slides else "rad"
    way = sp.S.Zero
    for joint, coordinate in zip(joints, coordinates, strict=True):
        name, about = f"{coordinate.name}_ref", f"{coordinate.name} in the reference pose of the model"
        way += coordinate - known.numbers.constant(name, joint.reference, unit, about)
    if first.slides:
        frame = frame.shifted(axis * way)
        return replace(frame, moving=frame.moving + axis * rate)
    anchor = known.length(called, first.anchor, "position of its joint")
    turned = frame.shifted(anchor).turned(_rotation(axis, way))
    turned = replace(turned, turning=turned.turning + axis * rate)
    return turned.shifted(-anchor)


def _rotation(axis: sp.Matrix, angle: sp.Expr) -> sp.Matrix:
    """Return the matrix of a rotation about an axis of length one, by Rodrigues' formula."""
    x, y, z = axis
    cross = sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    along = axis * axis.T
    return sp.cos(angle) * (sp.eye(3) - along) + sp.sin(angle) * cross + along


def _named(frame: _Frame, name: str, signals: dict[str, sp.Expr]) -> _Frame:
    """Return a frame whose longer parts are signals."""
    turning, moving, up = (
        sp.Matrix(
            [_signal(f"{name}_{what}_{axis}", value, signals) for axis, value in zip(AXES, own, strict=True)]
        )
        for what, own in (("turns", frame.turning), ("moves", frame.moving), ("up", frame.up))
    )
    return _Frame(turning, moving, up, _signal(f"{name}_lift", frame.lift, signals))


def _signal(name: str, value: sp.Expr, signals: dict[str, sp.Expr]) -> sp.Expr:
    if value.is_Atom or (-value).is_Atom:
        return value
    signals[name] = value
    return sp.Symbol(name, real=True)


def _add(found: Energies, body: TreeBody, frame: _Frame, known: _Known) -> None:
    if body.mass == 0.0 or frame.is_still:
        return
    constant, name = known.numbers.constant, known.body
    mass = constant(f"{name}_mass", body.mass, "kg", f"mass of {name}", Field("body", body.index, "mass"))
    center = frame.shifted(known.length("center", body.center, "its center of mass"))

    def about_center(i: int, j: int) -> sp.Expr:
        if frame.turning[i] == 0 or frame.turning[j] == 0:
            return sp.S.Zero
        called = f"{name}_inertia_{AXES[min(i, j)]}{AXES[max(i, j)]}"
        return constant(called, float(body.inertia[i, j]), "kg m^2", f"{name}: inertia about its center")

    inertia = sp.Matrix(3, 3, about_center)
    squared = sp.Add(*(speed**2 for speed in center.moving))
    turning = sp.Add(*(inertia[i, i] * frame.turning[i] ** 2 for i in range(3)))
    turning += 2 * sp.Add(
        *(inertia[i, j] * frame.turning[i] * frame.turning[j] for i in range(3) for j in range(i))
    )
    energies = {
        f"{name}_kinetic": (found.kinetic, (mass * squared + turning) / 2),
        f"{name}_potential": (found.potential, mass * _number(body.weight / body.mass) * center.lift),
    }
    for called, (terms, energy) in energies.items():
        if energy != 0:
            terms.append(_signal(called, energy, found.signals))


def _number(value: float) -> sp.Expr:
    """Return a number without a unit; whole ones stay whole, so that what cancels is gone."""
    nearest = round(value)
    return sp.Integer(nearest) if np.isclose(value, nearest, rtol=0.0, atol=1e-12) else sp.Float(value, 17)
