"""Equations of motion from drives, joints, energies and simulated bodies, and how an observer corrects them.

Lagrange's equations with the forces of drives and joints by virtual work.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import sympy as sp

from rigsight.effects.symbols import derivative
from rigsight.rigs import Coordinate, Rig, applied_symbol
from rigsight.simulate.equations.tree import EquationsOfMotion
from rigsight.units import size_of

Bound = Callable[[sp.Expr], sp.Expr]


def equations_of_motion(
    rig: Rig, bound: Bound, resisting: Mapping[str, tuple[sp.Expr, ...]], pulled: sp.Matrix | None = None
) -> EquationsOfMotion:
    """Return the equations of motion of a rig with n degrees of freedom."""
    mechanism, free = rig.mechanism, rig.mechanism.free
    terms: list[list[sp.Expr]] = [[] for _ in free]

    def add(along: sp.Expr, forces: Sequence[sp.Expr]) -> None:
        for own, coordinate in zip(terms, free, strict=True):
            slope = bound(derivative(along, coordinate.symbol))
            own += [slope * force for force in forces if slope != 0]

    for drive in mechanism.drives:
        add(drive.along, [bound(drive.force)])
    for joint in mechanism.joints:
        add(joint.motion, [-term for term in resisting[joint.name]])
    for own, force in zip(terms, mechanism.generalized_forces, strict=True):
        if force != 0:
            own.append(bound(force))
    if mechanism.bodies is not None:
        # The constraint forces of simulated bodies depend on all other applied forces.
        applied = {applied_symbol(i): sp.Add(*own) for i, own in enumerate(terms)}
        for own, force in zip(terms, mechanism.simulated_forces, strict=True):
            own.append(bound(force).xreplace(applied))
    mass = sp.ImmutableMatrix(mechanism.mass_matrix.applyfunc(bound))
    if pulled is not None:
        for own, force in zip(terms, mass * pulled, strict=True):
            own.append(force)
    one = mechanism.has_one_motion
    return EquationsOfMotion(
        coordinates=tuple(c.symbol for c in free),
        velocities=tuple(c.rate for c in free),
        mass=mass,
        terms=tuple(map(tuple, terms)),
        dimensions=("x",) if one else tuple(size_of(c.name) for c in free),
        rate_dimensions=("x time^-1",) if one else tuple(size_of(c.rate.name) for c in free),
    )


def measured_before(shown: Sequence[sp.Expr], delay: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return value and rate of a measured motion before a delay, by a Taylor series that is valid for small delays."""
    value, rate, curvature = shown
    return value + delay * rate + delay**2 / 2 * curvature, rate + delay * curvature


def observer_acceleration(
    free: Sequence[Coordinate],
    reads: sp.Expr,
    shown: tuple[sp.Expr, sp.Expr],
    measured: tuple[sp.Expr, sp.Expr],
    bandwidth: sp.Expr,
) -> sp.Matrix:
    """Return the accelerations of the free coordinates with which the error of one sensor decays, shape (n_degrees, 1)."""
    slopes = sp.Matrix([derivative(reads, c.rate) for c in free])
    if any(slope != 0 for slope in slopes):
        wanted = bandwidth * (measured[0] - shown[0])
    else:
        slopes = sp.Matrix([derivative(reads, c.symbol) for c in free])
        wanted = bandwidth**2 * (measured[0] - shown[0]) + sp.sqrt(2) * bandwidth * (measured[1] - shown[1])
    return slopes * (wanted / slopes.dot(slopes))
