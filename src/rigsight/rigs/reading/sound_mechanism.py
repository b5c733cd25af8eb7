"""Checks of a declared mechanism: energies, forces that act on a motion, sensors that read one."""

from __future__ import annotations

import warnings

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.rigs.evaluation import array_function
from rigsight.rigs.mechanism import Mechanism
from rigsight.rigs.parts import force_symbol, reading_symbol
from rigsight.rigs.reading.declaration import Declaration

_DRAWS = 20
"""Drawn parameters need not be those of any rig, so that the mass matrix of a sound one may have any signs."""
_SINGULAR = 1e-10
"""Smallest eigenvalue of the scaled mass matrix, relative to its largest, that is rounding."""
_SHARE = 0.1
"""Share of a coordinate in the motion without inertia from which it is named."""
_ROUNDING = 1e-9
"""Relative difference of two sums of the same terms that is rounding."""


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
    moving = {symbol for c in mechanism.coordinates for symbol in (c.symbol, c.rate)}
    moving |= {state.symbol for state in mechanism.states} | {force_symbol(j.name) for j in mechanism.joints}
    for sensor in mechanism.sensors:
        if not _reached(sensor.reads, mechanism) & moving:
            declaration.refuse(
                ("sensors", sensor.name, "reads"),
                "it reads nothing that moves: no coordinate, rate, state or force",
            )


def _check_feedback(declaration: Declaration, mechanism: Mechanism) -> None:
    """Refuse the force of a joint where it would act on the motion: it holds the acceleration's own causes."""
    forces = {force_symbol(joint.name) for joint in mechanism.joints}
    fed_back = {("joints", joint.name, "force"): joint.force for joint in mechanism.joints}
    fed_back |= {("drives", drive.name, "signal"): drive.signal for drive in mechanism.drives}
    fed_back |= {("drives", drive.name, "force"): drive.force for drive in mechanism.drives}
    fed_back |= {("states", state.name, "rate"): state.rate for state in mechanism.states}
    for path, expression in fed_back.items():
        if _reached(expression, mechanism) & forces:
            why = "it reads the force of a joint, which a sensor can record but which cannot be fed back"
            declaration.refuse(path, why)


def _reached(expression: sp.Expr, mechanism: Mechanism) -> set[sp.Symbol]:
    """Return all symbols that an expression reads, through signals, drives and sensors too."""
    through: dict[sp.Symbol, sp.Expr] = dict(mechanism.signals)
    through |= {sp.Symbol(drive.name, real=True): drive.signal for drive in mechanism.drives}
    through |= {reading_symbol(sensor.name): sensor.reads for sensor in mechanism.sensors}
    found: set[sp.Symbol] = set()
    while more := expression.free_symbols - found:
        found |= more
        expression = sp.Tuple(*(through[symbol] for symbol in more if symbol in through))
    return found


def is_quadratic(mechanism: Mechanism) -> bool:
    """Return True if the kinetic energy is a sum of squares and products of rates."""
    # Such functions, and no other continuous ones, have ``T(a + b) + T(a - b) = 2 T(a) + 2 T(b)``: P. Jordan, J. von Neumann,
    # Ann. Math. 36 (1935) 719. An energy that has no number at any place drawn is none.
    rates = [c.rate for c in mechanism.coordinates]
    others = sorted(mechanism.kinetic.free_symbols - set(rates), key=str)
    energy = array_function([*others, *rates], mechanism.kinetic)
    rng = np.random.default_rng(0)
    found = []
    for _ in range(_DRAWS):
        numbers, a, b = (rng.uniform(0.5, 2.0, len(own)) for own in (others, rates, rates))
        parts = np.array([_number(energy, numbers, r) for r in (a + b, a - b, a, b)])
        if np.all(np.isfinite(parts)):
            found.append(abs(parts @ (1.0, 1.0, -2.0, -2.0)) <= _ROUNDING * np.sum(np.abs(parts)))
    return bool(found) and all(found)


def _number(function: object, *arguments: NDArray[np.float64]) -> float:
    assert callable(function)
    with warnings.catch_warnings():
        # A root of what is negative at one place of many is no news.
        warnings.simplefilter("ignore")
        value = function(*np.concatenate(arguments))
    return float(np.real(value)) if np.isreal(value) else np.nan


def dependent_coordinates(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the degrees of freedom that can move without kinetic energy wherever the rig stands; none for a sound rig."""
    matrix = mechanism.mass_matrix
    if not mechanism.free:
        return ()
    symbols = sorted(matrix.free_symbols, key=str)
    function = array_function(symbols, matrix)
    rng = np.random.default_rng(0)
    motions = []
    for _ in range(_DRAWS):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mass = np.asarray(function(*rng.uniform(0.5, 2.0, len(symbols))))
        if not (np.all(np.isreal(mass)) and np.all(np.isfinite(mass))):
            continue
        mass = np.real(mass).astype(np.float64)
        size = np.sqrt(np.maximum(np.abs(np.diag(mass)), 1e-300))
        values, vectors = np.linalg.eigh(mass / np.outer(size, size))
        order = np.argsort(np.abs(values))
        if abs(values[order[0]]) > _SINGULAR * abs(values[order[-1]]):
            return ()
        motions.append(np.abs(vectors[:, order[0]]))
    shares = np.mean(motions, axis=0) if motions else np.ones(len(mechanism.free))
    return tuple(c.name for c, share in zip(mechanism.free, shares, strict=True) if share > _SHARE)


def negative_coordinates(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the degrees of freedom whose own inertia is negative whatever the parameters; none for a sound rig."""
    places, mass = {c.symbol for c in mechanism.coordinates}, mechanism.mass_matrix
    positive = {s: sp.Symbol(s.name, positive=True) for s in mass.free_symbols - places}
    return tuple(c.name for i, c in enumerate(mechanism.free) if mass[i, i].xreplace(positive).is_negative)
