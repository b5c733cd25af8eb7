"""Which rig does a checked rig file declare? Its tables and expressions as signals, numbers and mechanism."""

from __future__ import annotations

import math
from collections.abc import Mapping

import sympy as sp

from rigsight.parameters import Parameter
from rigsight.rigs.mechanism import Mechanism
from rigsight.rigs.parts import Coordinate, Drive, Joint, RateState, Sensor, Signal
from rigsight.rigs.reading.declaration import DRIVE_PARTS, JOINT_PARTS, Declaration, Path
from rigsight.rigs.reading.expressions import rate_name
from rigsight.rigs.reading.rig_tables import ConstantTable, ParameterTable
from rigsight.rigs.reading.simulator import simulated_bodies
from rigsight.rigs.rig import Alternative, Rig
from rigsight.units import size_of

_OF_A_JOINT = {"stiffness": "force x^-1", "damping": "force time x^-1", "rest": "x", "force": "force"}


_LARGEST, _LEAST = 1e18, 1e-15
"""Ends of what a number may be where none are declared, and the least one whose logarithm is searched."""


def rig_of(declaration: Declaration, order: list[Path]) -> Rig:
    """Return the rig."""
    table = declaration.table
    mechanism = _mechanism(declaration, order)
    one_motion = mechanism.has_one_motion
    return Rig(
        name=table.name,
        summary=table.summary,
        inputs=tuple(Signal(name, own.unit, own.about) for name, own in table.inputs.items()),
        constants=tuple(
            _parameter(declaration, "constants", name, own, "") for name, own in table.constants.items()
        ),
        parameters=tuple(
            _parameter(
                declaration,
                "parameters",
                name,
                own,
                sized_by(name, own.unit, mechanism) if one_motion else size_of(name),
            )
            for name, own in table.parameters.items()
        ),
        mechanism=mechanism,
        alternatives=tuple(
            Alternative(
                _parameter(declaration, "alternatives", name, own, ""),
                own.gives,
                declaration.sympy(("alternatives", name, "value")),
            )
            for name, own in table.alternatives.items()
        ),
        declaration=declaration.content,
    )


def _mechanism(declaration: Declaration, order: list[Path]) -> Mechanism:
    table, symbols, sympy = declaration.table, declaration.symbols, declaration.sympy
    signals = {symbols[str(path[1])]: sympy(path) for path in order if path[0] == "signals"}
    bodies = simulated_bodies(declaration)
    return Mechanism(
        inputs=tuple(table.inputs),
        coordinates=tuple(
            Coordinate(symbols[name], symbols[rate_name(name)], own.unit, own.prescribed_by, own.about)
            for name, own in table.coordinates.items()
        ),
        kinetic=_written_out(sympy(("energy", "kinetic")), signals),
        potential=_written_out(sympy(("energy", "potential")), signals),
        joints=tuple(
            Joint(
                name,
                **{part: sympy(("joints", name, part)) for part in JOINT_PARTS},
                inertia=None if own.inertia is None else sympy(("joints", name, "inertia")),
                damps_spring=own.damps_spring,
                about=own.about,
            )
            for name, own in table.joints.items()
        ),
        drives=tuple(
            Drive(name, **{part: sympy(("drives", name, part)) for part in DRIVE_PARTS}, about=own.about)
            for name, own in table.drives.items()
        ),
        sensors=tuple(
            Sensor(name, sympy(("sensors", name, "reads")), own.unit, own.about, own.upper_cut or math.inf)
            for name, own in table.sensors.items()
        ),
        states=tuple(
            RateState(
                symbols[name],
                sympy(("states", name, "rate")),
                own.unit,
                own.about,
            )
            for name, own in table.states.items()
        ),
        signals=signals,
        initial={
            **{symbols[name]: sympy(("initial", name)) for name in table.initial},
            **{
                symbols[name]: sympy(("states", name, "start"))
                for name, own in table.states.items()
                if own.start is not None
            },
        },
        order=tuple(str(path[1]) for path in order if path[0] != "signals"),
        bodies=bodies,
        asked=tuple(symbols[name] for name in table.simulator.parameters) if table.simulator else (),
    )


def _written_out(energy: sp.Expr, signals: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Return an energy of coordinates and rates alone, as it is differentiated by them."""
    known: dict[sp.Symbol, sp.Expr] = {}
    for symbol, signal in signals.items():
        known[symbol] = signal.xreplace(known)
    return energy.xreplace(known)


def _parameter(
    declaration: Declaration, key: str, name: str, own: ConstantTable, dimension_text: str
) -> Parameter:
    log = isinstance(own, ParameterTable) and own.log
    for end in ("lower", "upper"):
        bound = getattr(own, end)
        if log and bound is not None and bound <= 0.0:
            declaration.refuse(
                (key, name, end),
                f"log = true searches its logarithm, so {end} must be above 0, got {bound:g}",
            )
    if key == "alternatives" and own.default is not None:
        declaration.refuse((key, name, "default"), "an alternative has none; give its parameter a default")
    lower = own.lower if own.lower is not None else (_LEAST if log else -_LARGEST)
    upper = own.upper if own.upper is not None else _LARGEST
    if lower >= upper:
        end = "upper" if own.lower is None else "lower"
        declaration.refuse((key, name, end), f"lower = {lower:g} is not below upper = {upper:g}")
    if own.default is not None and not lower <= own.default <= upper:
        declaration.refuse((key, name, "default"), f"{own.default:g} is not within [{lower:g}, {upper:g}]")
    return Parameter(
        name,
        own.about,
        dimension_text,
        own.unit,
        lower=lower,
        upper=upper,
        default=own.default,
        logarithmic=log,
    )


def sized_by(name: str, unit: str, mechanism: Mechanism) -> str:
    """Return the dimension (`rigsight.units`) of a parameter on a rig with one joint; ``""`` where nothing sets its size."""
    if len(mechanism.joints) == 1 and len(mechanism.coordinates) == 1:
        joint = mechanism.joints[0]
        for part, dimension in _OF_A_JOINT.items():
            if _is(getattr(joint, part), name):
                return dimension
        if mechanism.free and _is(mechanism.mass_matrix[0, 0], name):
            return "force time^2 x^-1"
    return "length" if any(unit == state.unit for state in mechanism.states) else ""


def _is(expression: sp.Expr, name: str) -> bool:
    return expression in (sp.Symbol(name, real=True), -sp.Symbol(name, real=True))
