"""A rig file (TOML) -> the declaration of a rig. Nothing of it is executed; whatever is wrong is one message with its place."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Mapping
from functools import partial
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import sympy as sp

from rigsight.errors import InputError, nearest
from rigsight.parameters import Parameter
from rigsight.records.formats.known import file_size
from rigsight.rigs.mechanism import Mechanism, without_signals
from rigsight.rigs.parts import READING, Coordinate, Drive, Joint, RateState, Sensor, Signal
from rigsight.rigs.reading.declaration import (
    DRIVE_PARTS,
    JOINT_PARTS,
    ConstantTable,
    Declaration,
    ParameterTable,
)
from rigsight.rigs.reading.declared_names import check_all_used, check_declared_names, check_names_read
from rigsight.rigs.reading.dimensions import Units
from rigsight.rigs.reading.expressions import rate_name
from rigsight.rigs.reading.sound_mechanism import check_mechanism
from rigsight.rigs.reading.toml_places import Path as KeyPath
from rigsight.rigs.reading.toml_places import Place, toml_tables, value_places
from rigsight.rigs.rig import Alternative, Rig
from rigsight.simulators import KINDS, Bodies
from rigsight.simulators.bodies import model_digest
from rigsight.units import size_of

LARGEST_FILE = 1_000_000
_SIMULATOR = "simulator"
_OWNERS = {"states": "mujoco", "rates": "fmu", "forces": "fmu", "step": "fmu", "without_armature": "mujoco"}
"""Keys that one kind of simulator alone has."""


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
    """Return the rig that the tables of a file declare, as `tomllib` returns them."""
    # A check of units loads the library that knows them.
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
        Units(declaration).check(order)
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
    table, parameter = declaration.table, partial(_parameter, declaration)
    mechanism = _mechanism(declaration, order)
    one_motion = mechanism.has_one_motion
    return Rig(
        name=table.name,
        summary=table.summary,
        inputs=tuple(Signal(name, own.unit, own.about) for name, own in table.inputs.items()),
        constants=tuple(parameter("constants", name, own, "") for name, own in table.constants.items()),
        parameters=tuple(
            parameter(
                "parameters", name, own, sized_by(name, own.unit, mechanism) if one_motion else size_of(name)
            )
            for name, own in table.parameters.items()
        ),
        mechanism=mechanism,
        alternatives=tuple(
            Alternative(
                parameter("alternatives", name, own, ""),
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
    started: dict[str, KeyPath] = {name: ("initial", name) for name in table.initial}
    started |= {
        name: ("states", name, "start") for name, own in table.states.items() if own.start is not None
    }
    return Mechanism(
        inputs=tuple(table.inputs),
        coordinates=tuple(
            Coordinate(symbols[name], symbols[rate_name(name)], own.unit, own.prescribed_by, own.about)
            for name, own in table.coordinates.items()
        ),
        # Of coordinates and rates alone, as they are differentiated by them.
        kinetic=without_signals(sympy(("energy", "kinetic")), signals),
        potential=without_signals(sympy(("energy", "potential")), signals),
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
            RateState(symbols[name], sympy(("states", name, "rate")), own.unit, own.about)
            for name, own in table.states.items()
        ),
        signals=signals,
        initial={symbols[name]: sympy(path) for name, path in started.items()},
        order=tuple(str(path[1]) for path in order if path[0] != "signals"),
        bodies=bodies,
        asked=tuple(symbols[name] for name in (*table.simulator.parameters, *table.simulator.states))
        if table.simulator
        else (),
    )


def _parameter(
    declaration: Declaration, key: str, name: str, own: ConstantTable, dimension_text: str
) -> Parameter:
    log = isinstance(own, ParameterTable) and own.log
    for end in ("lower", "upper"):
        bound = getattr(own, end)
        if log and bound is not None and bound <= 0.0:
            why = f"log = true searches its logarithm, so {end} must be above 0, got {bound:g}"
            declaration.refuse((key, name, end), why)
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
        name, own.about, dimension_text, own.unit, lower, upper, default=own.default, logarithmic=log
    )


def sized_by(name: str, unit: str, mechanism: Mechanism) -> str:
    """Return the dimension (`rigsight.units`) of a parameter on a rig with one motion; ``""`` where nothing sets its size."""
    joint, own = mechanism.joints[0], sp.Symbol(name, real=True)
    for part, dimension in _OF_A_JOINT.items():
        if getattr(joint, part) in (own, -own):
            return dimension
    if mechanism.free and mechanism.mass_matrix[0, 0] in (own, -own):
        return "force time^2 x^-1"
    return "length" if any(unit == state.unit for state in mechanism.states) else ""


def check_simulator(declaration: Declaration) -> None:
    """Refuse a simulator of an unknown kind, and names in its table that are not declared."""
    table, own = declaration.table, declaration.table.simulator
    if own is None:
        return
    if own.kind not in KINDS:
        allowed = f"{nearest(own.kind, KINDS)} Allowed: {', '.join(KINDS)}"
        declaration.refuse((_SIMULATOR, "kind"), f"'{own.kind}' is not a simulator.{allowed}")
    free = [name for name, coordinate in table.coordinates.items() if coordinate.prescribed_by is None]
    if len(free) < len(table.coordinates) or not free:
        declaration.refuse(
            (_SIMULATOR,),
            "every coordinate of a simulated rig must be a degree of freedom; remove prescribed_by",
        )
    for key, wanted in _OWNERS.items():
        if getattr(own, key) and own.kind != wanted:
            declaration.refuse(
                (_SIMULATOR, key), f"it belongs to {wanted}, but this is {own.kind}; remove it"
            )
    if own.digest and own.kind == "python":
        declaration.refuse(
            (_SIMULATOR, "digest"), "it is of a model's file, and a Python function has none; remove it"
        )
    for key in ("coordinates", "rates", "forces", "parameters"):
        called = getattr(own, key)
        for name in called if key != "parameters" else ():
            declaration.check_known((_SIMULATOR, key, name), "coordinate", name, free)
        why = (
            "is given by two numbers; remove one"
            if key == "parameters"
            else "is used twice; each needs its own"
        )
        for name, there in called.items():
            if list(called.values()).count(there) > 1:
                declaration.refuse((_SIMULATOR, key, name), f"'{there}' {why}")
    for name in own.states:
        declaration.check_known((_SIMULATOR, "states", name), "state", name, table.states)
    numbers = declaration.names("constants", "parameters")
    for name in own.parameters:
        if name not in numbers:
            why = f"is neither a constant nor a parameter of this file.{nearest(name, numbers)} Declare it"
            declaration.refuse((_SIMULATOR, "parameters", name), f"'{name}' {why}")


def simulated_bodies(declaration: Declaration) -> Bodies | None:
    """Return the bodies that a rig file leaves to another program, or None; the program is opened to see that it has them."""
    table, own = declaration.table, declaration.table.simulator
    if own is None:
        return None
    free = list(table.coordinates)
    is_file = own.kind != "python"
    try:
        bodies = Bodies(
            own.kind,
            own.file,
            (own.digest or model_digest(own.kind, Path(own.file))) if is_file else "",
            tuple(own.coordinates.get(name, name) for name in free),
            tuple(own.parameters.values()),
            states=tuple(own.states.values()),
            rates=tuple(own.rates.get(name, "") for name in free),
            forces=tuple(own.forces.get(name, "") for name in free),
            step=own.step or 0.0,
            without_armature=own.without_armature,
        )
        _ = bodies.program
    except InputError as error:
        declaration.refuse((_SIMULATOR, "file"), str(error).removesuffix("."))
    return bodies


def with_whole_path(content: dict[str, object], folder: Path) -> dict[str, object]:
    """Return the tables of a rig file with the simulator's model by its absolute path, so that results find it."""
    own = content.get(_SIMULATOR)
    if not isinstance(own, dict) or own.get("kind") == "python" or not isinstance(own.get("file"), str):
        return content
    # What is wrong with the file is told with its place, once the tables are read.
    with contextlib.suppress(ValueError):
        own = {**own, "file": (folder / str(own["file"])).resolve().as_posix()}
    with contextlib.suppress(InputError):
        # A digest that stands there is kept: a model of another content is then refused.
        own = {"digest": model_digest(str(own.get("kind")), Path(str(own["file"]))), **own}
    return {**content, _SIMULATOR: own}
