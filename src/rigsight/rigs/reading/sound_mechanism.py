"""Checks of a declared mechanism: energies, forces that act on a motion, sensors that read one."""

from __future__ import annotations

import sympy as sp

from rigsight.rigs.mechanism import Mechanism
from rigsight.rigs.parts import force_symbol, reading_symbol
from rigsight.rigs.reading.declaration import Declaration
from rigsight.rigs.reading.mass import dependent_coordinates, is_quadratic, negative_coordinates


def check_mechanism(declaration: Declaration, mechanism: Mechanism) -> None:
    """Refuse a mechanism whose equations cannot be solved, or in which something is read or acts in vain."""
    # An FMU is a program, and reading a rig file runs none.
    if mechanism.bodies is None or mechanism.bodies.kind != "fmu":
        _check_mass(declaration, mechanism)
    _check_that_forces_act(declaration, mechanism)
    _check_sensors(declaration, mechanism)
    _check_feedback(declaration, mechanism)


def _check_mass(declaration: Declaration, mechanism: Mechanism) -> None:
    path = ("energy", "kinetic")
    rates = {c.rate for c in mechanism.coordinates}
    if not is_quadratic(mechanism) or mechanism.mass_matrix.free_symbols & rates:
        declaration.refuse(
            path,
            "a kinetic energy is a sum of squares and products of rates, such as 'm*d(x)^2/2'; terms without a rate belong to "
            "the potential energy",
        )
    negative = negative_coordinates(mechanism)
    if negative:
        declaration.refuse(path, f"it is negative when {', '.join(negative)} moves; change its sign")
    lacking = dependent_coordinates(mechanism)
    if lacking:
        together = " together" if len(lacking) > 1 else ""
        declaration.refuse(
            path,
            f"the mass matrix is singular: {', '.join(lacking)} can move{together} without energy; give each coordinate an "
            "inertia, or make it a state",
        )


def _check_that_forces_act(declaration: Declaration, mechanism: Mechanism) -> None:
    """Refuse joints and drives whose force would be ignored."""
    free = {c.symbol for c in mechanism.free}
    prescribed = {c.symbol for c in mechanism.prescribed}
    recorded = {symbol for sensor in mechanism.sensors for symbol in _reached(sensor.reads, mechanism)}
    degrees = ", ".join(c.name for c in mechanism.free) or "none"
    for joint in mechanism.joints:
        path, moving = ("joints", joint.name, "motion"), joint.motion.free_symbols
        if not moving & (free | prescribed):
            declaration.refuse(
                path,
                "it reads no coordinate, so the joint never moves; use one, such as 'phi', or a difference of two",
            )
        if not moving & free and force_symbol(joint.name) not in recorded:
            declaration.refuse(
                path,
                f"its motion is prescribed, and no sensor reads force({joint.name}), so its force would be ignored; let "
                "a sensor read it, or let the motion read a degree of freedom",
            )
    for drive in mechanism.drives:
        if not drive.along.free_symbols & free:
            declaration.refuse(
                ("drives", drive.name, "along"),
                f"it reads no degree of freedom, so the force would move nothing; degrees of freedom: {degrees}",
            )


def _check_sensors(declaration: Declaration, mechanism: Mechanism) -> None:
    moving = {c.symbol for c in mechanism.coordinates} | {c.rate for c in mechanism.coordinates}
    moving |= {state.symbol for state in mechanism.states}
    moving |= {force_symbol(joint.name) for joint in mechanism.joints}
    for sensor in mechanism.sensors:
        if not _reached(sensor.reads, mechanism) & moving:
            declaration.refuse(
                ("sensors", sensor.name, "reads"),
                "it reads nothing that moves: no coordinate, rate, state or force",
            )


def _check_feedback(declaration: Declaration, mechanism: Mechanism) -> None:
    """Refuse the force of a joint where it would act on the motion: it holds the acceleration's own causes."""
    forces = {force_symbol(joint.name) for joint in mechanism.joints}
    fed_back = {
        **{("joints", joint.name, "force"): joint.force for joint in mechanism.joints},
        **{("drives", drive.name, "signal"): drive.signal for drive in mechanism.drives},
        **{("drives", drive.name, "force"): drive.force for drive in mechanism.drives},
        **{("states", state.name, "rate"): state.rate for state in mechanism.states},
    }
    for path, expression in fed_back.items():
        if _reached(expression, mechanism) & forces:
            declaration.refuse(
                path, "it reads the force of a joint, which a sensor can record but which cannot be fed back"
            )


def _reached(expression: sp.Expr, mechanism: Mechanism) -> set[sp.Symbol]:
    """Return all symbols that an expression reads, through signals, drives and sensors too."""
    through: dict[sp.Symbol, sp.Expr] = dict(mechanism.signals)
    through |= {sp.Symbol(drive.name, real=True): drive.signal for drive in mechanism.drives}
    through |= {reading_symbol(sensor.name): sensor.reads for sensor in mechanism.sensors}
    found: set[sp.Symbol] = set()
    waiting = list(expression.free_symbols)
    while waiting:
        symbol = waiting.pop()
        if symbol not in found:
            found.add(symbol)
            if symbol in through:
                waiting.extend(through[symbol].free_symbols)
    return found
