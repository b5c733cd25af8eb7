"""A rig file (TOML) -> the declaration of a rig. Nothing of it is executed; whatever is wrong is one message with its place."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import sympy as sp

from rigsight.errors import InputError
from rigsight.parameters import Parameter
from rigsight.records.formats.known import file_size
from rigsight.rigs.mechanism import Mechanism
from rigsight.rigs.parts import READING, Coordinate, Drive, Joint, RateState, Sensor, Signal
from rigsight.rigs.reading.declaration import DRIVE_PARTS, JOINT_PARTS, Declaration
from rigsight.rigs.reading.declared_names import check_all_used, check_declared_names, check_names_read
from rigsight.rigs.reading.declared_units import check_units_add_up
from rigsight.rigs.reading.expressions import rate_name
from rigsight.rigs.reading.rig_tables import ConstantTable, ParameterTable
from rigsight.rigs.reading.simulator import check_simulator, simulated_bodies, with_whole_path
from rigsight.rigs.reading.sound_mechanism import check_mechanism
from rigsight.rigs.reading.toml_places import Path as KeyPath
from rigsight.rigs.reading.toml_places import Place, toml_tables, value_places
from rigsight.rigs.rig import Alternative, Rig
from rigsight.units import size_of

LARGEST_FILE = 1_000_000


def read_rig_file(path: Path) -> Rig:
    """Return the rig that a file declares.

    Raises
    ------
    InputError
        Naming the file, line and column, what was wrong and what to write instead.
    """
    if file_size(path, "the rig file") > LARGEST_FILE:
        raise InputError(f"{path}: a rig file may have at most {LARGEST_FILE / 1e6:g} MB.")
    try:
        text = path.read_text("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not text in UTF-8 (byte {error.start}).") from None
    return rig_of_text(text, str(path), folder=path.parent)


def rig_of_text(
    text: str, source: str = "rig file", *, check_units: bool = True, folder: Path | None = None
) -> Rig:
    """Return the rig that a text declares."""
    content = toml_tables(text, source)
    if folder is not None:
        content = with_whole_path(content, folder)
    return _rig_of(content, value_places(text), source, check_units)


def rig_of_tables(tables: Mapping[str, Any], source: str, *, check_units: bool = True) -> Rig:
    """Return the rig that the tables of a file declare.

    Parameters
    ----------
    tables
        As `tomllib` returns them.
    source
        How messages call it.
    check_units
        Whether to check that units add up, which loads the library that knows them.

    Raises
    ------
    InputError
        Naming the table and key of what was wrong, and what to write instead.
    """
    return _rig_of(tables, {}, source, check_units)


_read: dict[str, Rig] = {}
"""Rigs by their declaration: the same one is the same object, whichever file holds it, so that its equations are made once."""
_with_checked_units: set[str] = set()
"""Declarations whose units are known to add up."""


def _rig_of(
    tables: Mapping[str, Any], places: Mapping[KeyPath, Place], source: str, check_units: bool
) -> Rig:
    try:
        key = json.dumps(tables)
    except (TypeError, ValueError, RecursionError):
        # Dates, or what is no table at all: the reader says so.
        key = ""
    if key in _read and (key in _with_checked_units or not check_units):
        return _read[key]
    rig = _checked(Declaration(dict(tables), places, source), check_units)
    if not key:
        return rig
    if check_units:
        _with_checked_units.add(key)
    return _read.setdefault(key, rig)


def _checked(declaration: Declaration, check_units: bool) -> Rig:
    check_declared_names(declaration)
    check_simulator(declaration)
    check_names_read(declaration)
    order = signal_order(declaration)
    if check_units:
        check_units_add_up(declaration, order)
    check_all_used(declaration)
    rig = rig_of(declaration, order)
    check_mechanism(declaration, rig.mechanism)
    return rig


def signal_order(declaration: Declaration) -> list[KeyPath]:
    """Return the paths of signals, drives and sensors so that each reads only those in front of it."""
    table = declaration.table
    own: dict[str, KeyPath] = {
        **{name: ("signals", name) for name in table.signals},
        **{name: ("drives", name, "signal") for name in table.drives},
        **{f"{READING}{name}": ("sensors", name, "reads") for name in table.sensors},
    }
    graph: dict[str, set[str]] = {}
    for node, path in own.items():
        read = {
            f"{READING}{name}" if declaration.reads_sensor(path, name) else name
            for name in declaration.expressions[path].reads
        }
        graph[node] = {name for name in read if name in own}
    try:
        return [own[node] for node in TopologicalSorter(graph).static_order()]
    except CycleError as error:
        loop = [name.removeprefix(READING) for name in reversed(error.args[1])]
        declaration.refuse(
            own[error.args[1][0]],
            f"an algebraic loop (no state in it): {' -> '.join(loop)}; each needs the value of the next",
        )


_OF_A_JOINT = {"stiffness": "force x^-1", "damping": "force time x^-1", "rest": "x", "force": "force"}


_LARGEST, _LEAST = 1e18, 1e-15
"""Ends of what a number may be where none are declared, and the least one whose logarithm is searched."""


def rig_of(declaration: Declaration, order: list[KeyPath]) -> Rig:
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


def _mechanism(declaration: Declaration, order: list[KeyPath]) -> Mechanism:
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
        asked=tuple(symbols[name] for name in (*table.simulator.parameters, *table.simulator.states))
        if table.simulator
        else (),
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
