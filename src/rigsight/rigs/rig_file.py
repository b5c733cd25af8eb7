"""A rig file (TOML) -> the declaration of a rig. Nothing of it is executed; whatever is wrong is one message with its place."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any, NoReturn

import sympy as sp
from pydantic import ValidationError

from rigsight.errors import InputError, nearest, shown
from rigsight.parameters import Parameter
from rigsight.records.ordinary_file import file_size
from rigsight.rigs.dimensions import Dimension, UnitError, dimension, dimension_of, unit_of
from rigsight.rigs.expressions import (
    FUNCTIONS,
    Expression,
    ExpressionError,
    force_name,
    is_identifier,
    parsed,
    rate_name,
    to_sympy,
)
from rigsight.rigs.mass import dependent_coordinates
from rigsight.rigs.mechanism import (
    READING,
    Coordinate,
    Drive,
    Joint,
    Mechanism,
    RateState,
    Sensor,
    reading_symbol,
)
from rigsight.rigs.rig import Alternative, Rig
from rigsight.rigs.rig_tables import ConstantTable, ParameterTable, RigTable, told
from rigsight.rigs.roles import sized_by
from rigsight.rigs.signal import Signal
from rigsight.rigs.toml_places import value_places
from rigsight.units import size_of

LARGEST_FILE = 1_000_000
_LONGEST_NAME = 60
_NAMED = ("inputs", "constants", "parameters", "alternatives", "coordinates", "states", "signals", "drives")
"""Tables whose names no two entries may share."""
_JOINT_PARTS = ("motion", "stiffness", "damping", "rest", "force")
_DRIVE_PARTS = ("signal", "force", "along")
_TIME = "s"
_ENERGY = "J"


def read_rig_file(path: Path) -> Rig:
    """Return the rig that a file declares.

    Raises
    ------
    InputError
        Naming the file, line and column, what was wrong and what to write instead.
    """
    if file_size(path, "the rig file") > LARGEST_FILE:
        raise InputError(f"{path}: a rig file may have {LARGEST_FILE / 1e6:g} MB.")
    try:
        text = path.read_text("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not text in UTF-8 (byte {error.start}).") from None
    return rig_of_text(text, str(path))


def rig_of_text(text: str, source: str = "rig file", *, check_units: bool = True) -> Rig:
    """Return the rig that a text declares.

    Parameters
    ----------
    text
        TOML.
    source
        How messages call it.
    check_units
        False for a text whose units are known to add up.

    Raises
    ------
    InputError
        As `read_rig_file`.
    """
    try:
        content = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{source}: is no valid TOML: {error}") from None
    return _rig_of(content, value_places(text), source, check_units)


def rig_of_tables(tables: Mapping[str, Any], source: str) -> Rig:
    """Return the rig that the tables of a file declare.

    Parameters
    ----------
    tables
        As `tomllib` returns them.
    source
        How messages call it.

    Raises
    ------
    InputError
        Naming the table and key of what was wrong, and what to write instead.
    """
    return _rig_of(tables, {}, source, check_units=True)


_read: dict[str, Rig] = {}
"""Rigs by their declaration: the same one is the same object, whichever file holds it, so that its equations are made once."""


def _rig_of(
    tables: Mapping[str, Any],
    places: Mapping[tuple[str | int, ...], tuple[int, int]],
    source: str,
    check_units: bool,
) -> Rig:
    try:
        key = json.dumps(tables)
    except (TypeError, ValueError, RecursionError):
        # Dates, or what is no table at all: the reader says so.
        key = ""
    if key not in _read:
        rig = _Reader(dict(tables), places, source).rig(check_units)
        if not key:
            return rig
        _read[key] = rig
    return _read[key]


class _Reader:
    """Checks a rig table by table; every message has the place of what it is about."""

    def __init__(
        self, content: dict[str, Any], places: Mapping[tuple[str | int, ...], tuple[int, int]], source: str
    ) -> None:
        self._places = places
        self._source = source
        self._content = content
        try:
            self._table = RigTable.model_validate(content)
        except ValidationError as error:
            # A key that is missing may be the one that is misspelled.
            first = min(error.errors(), key=lambda found: found["type"] != "extra_forbidden")
            path = first["loc"]
            # pydantic appends which of several types it tried.
            self._refuse(
                path[:-1] if path and path[-1] in ("constrained-str", "float") else path, told(first)
            )
        self._expressions: dict[tuple[str, ...], Expression] = {}

    def rig(self, check_units: bool) -> Rig:
        """Read it."""
        table = self._table
        for key in ("coordinates", "sensors"):
            if not getattr(table, key):
                self._refuse((key,), f"a rig needs at least one [{key}.NAME]")
        self._check_names()
        self._symbols = self._declared_symbols()
        self._parse()
        self._check_names_read()
        order = self._signal_order()
        if check_units:
            self._check_dimensions(order)
        self._check_all_used()
        mechanism = self._mechanism(order)
        self._check_mechanism(mechanism)
        return Rig(
            name=table.name,
            summary=table.summary,
            inputs=tuple(Signal(name, own.unit, own.about) for name, own in table.inputs.items()),
            constants=tuple(
                self._parameter("constants", name, own, "") for name, own in table.constants.items()
            ),
            parameters=tuple(
                self._parameter(
                    "parameters",
                    name,
                    own,
                    sized_by(name, own.unit, mechanism) if mechanism.has_one_motion else size_of(name),
                )
                for name, own in table.parameters.items()
            ),
            mechanism=mechanism,
            alternatives=tuple(
                Alternative(
                    self._parameter("alternatives", name, own, ""),
                    own.gives,
                    self._sympy(("alternatives", name, "value")),
                )
                for name, own in table.alternatives.items()
            ),
            declaration=self._content,
        )

    def _refuse(self, path: Iterable[str | int], message: str, within: int | None = None) -> NoReturn:
        """Raise the message with the place of a value, or of the nearest table around it."""
        path = tuple(path)
        place = None
        for length in range(len(path), 0, -1):
            place = self._places.get(path[:length])
            if place is not None:
                break
        where = ""
        if place is not None:
            column = place[1] + (within + 1 if within is not None and len(path) == length else 0)
            where = f", line {place[0]}, column {column}"
        named = ".".join(map(str, path))
        raise InputError(
            f"{self._source}{where}: {named}: {message}." if named else f"{self._source}{where}: {message}."
        )

    def _check_names(self) -> None:
        table = self._table
        # Results and exported files are called after it.
        self._check_name(("name",), table.name)
        taken: dict[str, str] = {}
        for key in _NAMED:
            for name in getattr(table, key):
                self._check_name((key, name), name)
                if name in taken:
                    self._refuse(
                        (key, name), f"the name '{name}' is taken by {taken[name]}.{name}; name it otherwise"
                    )
                taken[name] = key
        for name in table.sensors:
            self._check_name(("sensors", name), name)
            # A column may be called as the coordinate or state that it shows.
            if name in taken and taken[name] not in ("coordinates", "states"):
                self._refuse(
                    ("sensors", name),
                    f"the name '{name}' is taken by {taken[name]}.{name}; name it otherwise",
                )
        places: dict[str, str] = {}
        for key in ("joints", "drives", "sensors"):
            for name in getattr(table, key):
                self._check_name((key, name), name)
                if name in places:
                    self._refuse(
                        (key, name),
                        f"{places[name]}.{name} has the same name; effects act at places, so each needs its own",
                    )
                places[name] = key

    def _check_name(self, path: tuple[str, ...], name: str) -> None:
        if not is_identifier(name):
            self._refuse(
                path, f"{shown(name)} is no name: letters, digits and _ make one, and it begins with no digit"
            )
        # `force` and `d` are functions only where parentheses follow.
        if name in FUNCTIONS or name == "t":
            what = "the time column" if name == "t" else "a function"
            self._refuse(path, f"'{name}' is {what}; name it otherwise")
        if len(name) > _LONGEST_NAME:
            self._refuse(path, f"a name may have {_LONGEST_NAME} characters")

    def _declared_dimensions(self) -> dict[str, Dimension]:
        table = self._table
        found: dict[str, Dimension] = {}
        for key in ("inputs", "constants", "parameters", "alternatives", "coordinates", "states", "sensors"):
            for name, own in getattr(table, key).items():
                try:
                    measured = dimension(own.unit)
                except UnitError as error:
                    self._refuse((key, name, "unit"), str(error))
                found.setdefault(name, measured)
                if key == "coordinates":
                    found[rate_name(name)] = measured / dimension(_TIME)
        return found

    def _declared_symbols(self) -> dict[str, sp.Symbol]:
        names = [name for key in (*_NAMED, "sensors") for name in getattr(self._table, key)]
        names += [force_name(name) for name in self._table.joints]
        rates = {
            rate_name(name): own.rate or rate_name(name) for name, own in self._table.coordinates.items()
        }
        written = dict(zip(names, names, strict=True)) | rates
        return {name: sp.Symbol(symbol, real=True) for name, symbol in written.items()}

    def _parse(self) -> None:
        table = self._table
        fields: dict[str, tuple[str, ...]] = {
            "joints": (*_JOINT_PARTS, "inertia"),
            "drives": _DRIVE_PARTS,
            "sensors": ("reads",),
            "states": ("rate", "start"),
            "alternatives": ("value",),
        }
        for name in ("kinetic", "potential"):
            self._parse_one(("energy", name), getattr(table.energy, name))
        for key, names in fields.items():
            for name, own in getattr(table, key).items():
                for field in names:
                    if getattr(own, field) is not None:
                        self._parse_one((key, name, field), getattr(own, field))
        for key in ("signals", "initial"):
            for name, formula in getattr(table, key).items():
                self._parse_one((key, name), formula)

    def _parse_one(self, path: tuple[str, ...], formula: str | float) -> None:
        text = formula if isinstance(formula, str) else f"{formula:.17g}"
        try:
            self._expressions[path] = parsed(text)
        except ExpressionError as error:
            self._refuse(path, f"{error}, in '{_cut(text)}'", error.place)

    def _names_of(self, *keys: str) -> set[str]:
        return {name for key in keys for name in getattr(self._table, key)}

    def _allowed(self, path: tuple[str, ...]) -> set[str]:
        """Return what an expression may read."""
        numbers = self._names_of("constants", "parameters")
        motion = self._names_of("coordinates")
        rates = {rate_name(name) for name in motion}
        everything = (
            numbers | motion | rates | self._names_of("inputs", "states", "signals", "drives", "sensors")
        )
        match path:
            case ("energy", "potential") | ("joints", _, "motion") | ("drives", _, "along"):
                return numbers | motion
            case ("energy", "kinetic"):
                return numbers | motion | rates
            case ("joints", _, "force"):
                return numbers | motion | rates | self._names_of("states", "signals")
            case ("joints", _, _) | ("initial", _) | ("states", _, "start"):
                return numbers
            case ("alternatives", name, _):
                return self._names_of("constants") | {name}
            case ("sensors", _, _):
                return everything | {force_name(name) for name in self._table.joints}
        return everything

    def _check_names_read(self) -> None:
        """Refuse names that an expression cannot read."""
        for path, expression in self._expressions.items():
            allowed = self._allowed(path)
            for name, place in expression.reads.items():
                if name in allowed:
                    continue
                if name in self._symbols:
                    self._refuse(path, f"'{name}' cannot be read here: {_WHAT_MAY_BE_READ[path[0]]}", place)
                self._refuse(
                    path, f"'{name}' is not declared.{nearest(name, allowed)}{_declare(name)}", place
                )

    def _check_all_used(self) -> None:
        """Refuse what no equation reads: it would be ignored."""
        table = self._table
        read = {name for expression in self._expressions.values() for name in expression.reads}
        read |= {own.prescribed_by for own in table.coordinates.values() if own.prescribed_by is not None}
        for key in ("inputs", "constants", "parameters", "signals"):
            for name in getattr(table, key):
                if name not in read:
                    self._refuse((key, name), f"no equation reads '{name}'; take it out, or use it")
        for name in table.drives:
            if name not in self._expressions["drives", name, "force"].reads:
                self._refuse(
                    ("drives", name, "force"),
                    f"it does not read '{name}', the signal of its drive behind the effects",
                )

    def _signal_order(self) -> list[str]:
        """Return signals, drives and sensors so that each reads only those in front of it."""
        own = {
            **{name: ("signals", name) for name in self._table.signals},
            **{name: ("drives", name, "signal") for name in self._table.drives},
            **{_as_sensor(name): ("sensors", name, "reads") for name in self._table.sensors},
        }
        graph: dict[str, set[str]] = {}
        for node, path in own.items():
            expression = self._expressions[path]
            read = {self._meaning(path, name) for name in expression.reads}
            graph[node] = {name for name in read if name in own}
        try:
            return list(TopologicalSorter(graph).static_order())
        except CycleError as error:
            loop = [name.removeprefix(_SENSOR) for name in reversed(error.args[1])]
            self._refuse(
                own[error.args[1][0]],
                f"a loop without a state in it: {' -> '.join(loop)}; each needs the value of the next",
            )

    def _meaning(self, path: tuple[str, ...], name: str) -> str:
        """Return what a name reads: a sensor in a control law, else the coordinate or state that is called the same."""
        if name not in self._table.sensors:
            return name
        shared = name in self._table.coordinates or name in self._table.states
        in_control = path[0] == "drives" and path[-1] == "signal"
        return _as_sensor(name) if in_control or not shared else name

    def _check_dimensions(self, order: list[str]) -> None:
        found, energy, second = self._declared_dimensions(), dimension(_ENERGY), dimension(_TIME)
        by_name = dict(found)

        def measured(path: tuple[str, ...]) -> Dimension:
            expression = self._expressions[path]
            try:
                return dimension_of(expression, by_name)
            except ExpressionError as error:
                self._refuse(path, f"{error}, in '{_cut(expression.text)}'", error.place)

        def is_(path: tuple[str, ...], wanted: Dimension, why: str) -> None:
            got = measured(path)
            if got is not None and wanted is not None and got != wanted:
                text = _cut(self._expressions[path].text)
                self._refuse(path, f"'{text}' is in {unit_of(got)}; {why} {unit_of(wanted)}")

        joint_force: dict[str, Dimension] = {}
        for name in self._table.joints:
            motion = measured(("joints", name, "motion"))
            by_name[force_name(name)] = joint_force[name] = None if motion is None else energy / motion
        for name in order:
            if name.startswith(_SENSOR):
                sensor = name.removeprefix(_SENSOR)
                is_(("sensors", sensor, "reads"), dimension(self._table.sensors[sensor].unit), "its unit is")
                by_name.setdefault(sensor, dimension(self._table.sensors[sensor].unit))
            else:
                by_name[name] = measured(
                    ("signals", name) if name in self._table.signals else ("drives", name, "signal")
                )
        for part in ("kinetic", "potential"):
            is_(("energy", part), energy, "an energy is in J, that is")
        for name, own in self._table.joints.items():
            motion, force = measured(("joints", name, "motion")), joint_force[name]
            if motion is None or force is None:
                continue
            is_(("joints", name, "stiffness"), force / motion, "the motion makes it")
            is_(("joints", name, "damping"), force * second / motion, "the motion makes it")
            is_(("joints", name, "rest"), motion, "the motion is in")
            is_(("joints", name, "force"), force, "the motion makes it")
            if own.inertia is not None:
                is_(("joints", name, "inertia"), force * second**2 / motion, "the motion makes it")
        for name in self._table.drives:
            along = measured(("drives", name, "along"))
            is_(
                ("drives", name, "force"),
                None if along is None else energy / along,
                "force times what it acts along is J: it is in",
            )
        for name, state in self._table.states.items():
            is_(("states", name, "rate"), dimension(state.unit) / second, "the state's unit makes it")
            is_(("states", name, "start"), dimension(state.unit), "the state is in")
        for name, alternative in self._table.alternatives.items():
            if alternative.gives not in self._table.parameters:
                self._refuse(
                    ("alternatives", name, "gives"),
                    f"there is no parameter '{alternative.gives}'.{nearest(alternative.gives, self._table.parameters)}",
                )
            is_(("alternatives", name, "value"), found[alternative.gives], f"{alternative.gives} is in")
        for name in self._table.initial:
            wanted = found.get(name)
            if wanted is None:
                known = [
                    *self._table.coordinates,
                    *map(rate_name, self._table.coordinates),
                    *self._table.states,
                ]
                self._refuse(
                    ("initial", name),
                    f"'{name}' is no coordinate, rate or state.{nearest(name, known)} Known: {', '.join(known)}",
                )
            is_(("initial", name), wanted, "it starts in")

    def _mechanism(self, order: list[str]) -> Mechanism:
        table = self._table
        coordinates = []
        for name, own in table.coordinates.items():
            if own.prescribed_by is not None and own.prescribed_by not in table.inputs:
                self._refuse(
                    ("coordinates", name, "prescribed_by"),
                    f"there is no input '{own.prescribed_by}'.{nearest(own.prescribed_by, table.inputs)} "
                    f"Declared: {', '.join(table.inputs) or 'none'}",
                )
            coordinates.append(
                Coordinate(
                    self._symbols[name],
                    self._symbols[rate_name(name)],
                    own.unit,
                    own.prescribed_by,
                    own.about,
                )
            )
        return Mechanism(
            inputs=tuple(table.inputs),
            coordinates=tuple(coordinates),
            kinetic=self._sympy(("energy", "kinetic")),
            potential=self._sympy(("energy", "potential")),
            joints=tuple(
                Joint(
                    name,
                    **{part: self._sympy(("joints", name, part)) for part in _JOINT_PARTS},
                    inertia=None if own.inertia is None else self._sympy(("joints", name, "inertia")),
                    about=own.about,
                )
                for name, own in table.joints.items()
            ),
            drives=tuple(
                Drive(
                    name,
                    **{part: self._sympy(("drives", name, part)) for part in _DRIVE_PARTS},
                    about=own.about,
                )
                for name, own in table.drives.items()
            ),
            sensors=tuple(
                Sensor(name, self._sympy(("sensors", name, "reads")), own.unit, own.about)
                for name, own in table.sensors.items()
            ),
            states=tuple(
                RateState(
                    self._symbols[name],
                    self._sympy(("states", name, "rate")),
                    own.unit,
                    self._sympy(("states", name, "start")),
                    own.about,
                )
                for name, own in table.states.items()
            ),
            signals={
                self._symbols[name]: self._sympy(("signals", name)) for name in order if name in table.signals
            },
            initial={self._symbols[name]: self._sympy(("initial", name)) for name in table.initial},
            order=tuple(name.removeprefix(_SENSOR) for name in order if name not in table.signals),
        )

    def _sympy(self, path: tuple[str, ...]) -> sp.Expr:
        expression = self._expressions[path]
        symbols: dict[str, sp.Expr] = dict(self._symbols)
        for name in self._table.sensors:
            if self._meaning(path, name) == _as_sensor(name):
                symbols[name] = reading_symbol(name)
        try:
            return to_sympy(expression, symbols)
        except ExpressionError as error:
            self._refuse(path, f"{error}, in '{_cut(expression.text)}'", error.place)

    def _check_mechanism(self, mechanism: Mechanism) -> None:
        rates = [c.rate for c in mechanism.coordinates]
        squares = sum(
            (sp.diff(mechanism.kinetic, a, b) * a * b / 2 for a in rates for b in rates), start=sp.Integer(0)
        )
        if any(sp.simplify(sp.diff(mechanism.kinetic - squares, rate)) != 0 for rate in rates):
            self._refuse(("energy", "kinetic"), "a kinetic energy is a sum of squares and products of rates")
        lacking = dependent_coordinates(mechanism)
        if lacking:
            self._refuse(
                ("energy", "kinetic"),
                f"the mass matrix is singular: no energy moves with {', '.join(lacking)}; give each coordinate an inertia, or "
                "make it a state",
            )
        self._check_that_forces_act(mechanism)
        moving = {c.symbol for c in mechanism.coordinates} | {c.rate for c in mechanism.coordinates}
        moving |= {state.symbol for state in mechanism.states}
        moving |= {self._symbols[force_name(joint.name)] for joint in mechanism.joints}
        for sensor in mechanism.sensors:
            if not _reached(sensor.reads, mechanism) & moving:
                self._refuse(
                    ("sensors", sensor.name, "reads"),
                    "nothing that moves is read: no coordinate, rate, state or force",
                )

        forces = {self._symbols[force_name(joint.name)] for joint in mechanism.joints}
        fed_back = {
            **{("joints", joint.name, "force"): joint.force for joint in mechanism.joints},
            **{("drives", drive.name, "signal"): drive.signal for drive in mechanism.drives},
            **{("drives", drive.name, "force"): drive.force for drive in mechanism.drives},
            **{("states", state.name, "rate"): state.rate for state in mechanism.states},
        }
        for path, expression in fed_back.items():
            if _reached(expression, mechanism) & forces:
                self._refuse(
                    path, "the force of a joint is read; it can be recorded by a sensor, not fed back"
                )

    def _check_that_forces_act(self, mechanism: Mechanism) -> None:
        """Refuse joints and drives whose force would be ignored."""
        free = {c.symbol for c in mechanism.free}
        prescribed = {c.symbol for c in mechanism.prescribed}
        recorded = {symbol for sensor in mechanism.sensors for symbol in _reached(sensor.reads, mechanism)}
        degrees = ", ".join(c.name for c in mechanism.free) or "none"
        for joint in mechanism.joints:
            path, moving = ("joints", joint.name, "motion"), joint.motion.free_symbols
            if not moving & (free | prescribed):
                self._refuse(
                    path,
                    "it reads no coordinate, so the joint never moves; write one, as 'phi', or a difference of two",
                )
            if not moving & free and self._symbols[force_name(joint.name)] not in recorded:
                self._refuse(
                    path,
                    f"its motion is prescribed, and no sensor reads force({joint.name}), so its force would be ignored; let "
                    "a sensor read it, or let the motion read a degree of freedom",
                )
        for drive in mechanism.drives:
            if not drive.along.free_symbols & free:
                self._refuse(
                    ("drives", drive.name, "along"),
                    f"it reads no degree of freedom, so the force would move nothing; degrees of freedom: {degrees}",
                )

    def _parameter(self, key: str, name: str, own: ConstantTable, dimension_text: str) -> Parameter:
        log = isinstance(own, ParameterTable) and own.log
        for end in ("lower", "upper"):
            bound = getattr(own, end)
            if log and bound is not None and bound <= 0.0:
                self._refuse(
                    (key, name, end),
                    f"log = true searches its logarithm, so {end} lies above 0, got {bound:g}",
                )
        lower = own.lower if own.lower is not None else (_LEAST if log else -_LARGEST)
        upper = own.upper if own.upper is not None else _LARGEST
        if lower >= upper:
            self._refuse((key, name, "lower"), f"lower = {lower:g} is not below upper = {upper:g}")
        if own.default is not None and not lower <= own.default <= upper:
            self._refuse((key, name, "default"), f"{own.default:g} is not within [{lower:g}, {upper:g}]")
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


_LARGEST, _LEAST = 1e18, 1e-15
_SENSOR = READING


def _as_sensor(name: str) -> str:
    return f"{_SENSOR}{name}"


_WHAT_MAY_BE_READ = {
    "energy": "an energy is made of coordinates, rates, parameters and constants",
    "joints": "a joint's motion is made of coordinates; stiffness, damping, rest and inertia of parameters and constants; its "
    "force of these, rates, states and signals",
    "alternatives": "the value that follows is made of it and of constants",
    "drives": "what a force acts along is made of coordinates, parameters and constants",
    "initial": "a start value is made of parameters and constants",
    "states": "a start value is made of parameters and constants",
    "sensors": "force(...) is that of a joint",
    "signals": "force(...) is read by sensors alone",
}


def _declare(name: str) -> str:
    if "(" in name:
        return " Rates are those of coordinates, forces those of joints"
    return f" Declare it: [parameters.{name}] to identify it, [constants.{name}] if it is known"


def _cut(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:57]}..."


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
