"""Checks of the names of a rig file: unique, declared where they are used, and used at all."""

from __future__ import annotations

from collections.abc import Iterable

from rigsight.errors import nearest, shown
from rigsight.rigs.reading.declaration import NAMED, Declaration
from rigsight.rigs.reading.expressions import FUNCTIONS, force_name, is_identifier, rate_name
from rigsight.rigs.reading.toml_places import Path

_LONGEST_NAME = 60
_NUMBERS = "parameters and constants"
_NEEDED = {
    "coordinates": "a motion, or a [states.NAME]",
    "joints": "a place where friction and other effects can act; one without resistance needs only a motion",
    "sensors": "a recorded signal",
}
"""Tables without which there is nothing to diagnose."""
_PLACES = ("joints", "drives", "sensors")
"""Tables whose entries are places where effects act."""


def check_declared_names(declaration: Declaration) -> None:
    """Refuse names that are none, that are taken, and those that stand for nothing where a name must."""
    table = declaration.table
    for key, what in _NEEDED.items():
        # States alone may move: levels, temperatures, pressures.
        if key == "coordinates" and table.states:
            continue
        # Where every motion is prescribed, or there is none, sensors alone may be what is identified.
        if key == "joints" and all(c.prescribed_by for c in table.coordinates.values()):
            continue
        if not getattr(table, key):
            declaration.refuse((), f"a rig needs at least one [{key}.NAME], {what}")
    # Results and exported files are called after it.
    _check_name(declaration, ("name",), table.name)
    taken: dict[str, str] = {}
    for key in NAMED:
        for name in getattr(table, key):
            _check_name(declaration, (key, name), name)
            _check_free(declaration, (key, name), name, taken)
            taken[name] = f"{key}.{name}"
    for name in table.sensors:
        _check_name(declaration, ("sensors", name), name)
        # A column may be called as the coordinate or state that it shows.
        if name not in table.coordinates and name not in table.states:
            _check_free(declaration, ("sensors", name), name, taken)
    for name, own in table.coordinates.items():
        if own.rate is not None:
            path = ("coordinates", name, "rate")
            _check_name(declaration, path, own.rate)
            _check_free(declaration, path, own.rate, taken)
            taken[own.rate] = f"coordinates.{name}.rate"
    _check_places(declaration)
    _check_references(declaration)


def _check_name(declaration: Declaration, path: Path, name: str) -> None:
    if not is_identifier(name):
        declaration.refuse(
            path, f"{shown(name)} is not a name: use letters, digits and _, and do not begin with a digit"
        )
    # `force` and `d` are functions only where parentheses follow.
    if name in FUNCTIONS or name == "t":
        what = "the time column" if name == "t" else "a function"
        declaration.refuse(path, f"'{name}' is {what}; choose another name")
    if len(name) > _LONGEST_NAME:
        declaration.refuse(path, f"a name may have {_LONGEST_NAME} characters, this one has {len(name)}")


def _check_free(declaration: Declaration, path: Path, name: str, taken: dict[str, str]) -> None:
    if name in taken:
        declaration.refuse(path, f"the name '{name}' is already used by [{taken[name]}]; choose another name")


def _check_places(declaration: Declaration) -> None:
    places: dict[str, str] = {}
    for key in _PLACES:
        for name in getattr(declaration.table, key):
            _check_name(declaration, (key, name), name)
            if name in places:
                why = "has the same name; effects act at places, so each needs its own"
                declaration.refuse((key, name), f"[{places[name]}.{name}] {why}")
            places[name] = key


def _check_references(declaration: Declaration) -> None:
    """Refuse names in keys and values that stand for a declared thing, and do not."""
    table = declaration.table
    for name, own in table.coordinates.items():
        if own.prescribed_by is not None:
            path = ("coordinates", name, "prescribed_by")
            declaration.check_known(path, "input", own.prescribed_by, table.inputs)
    for name, alternative in table.alternatives.items():
        path = ("alternatives", name, "gives")
        declaration.check_known(path, "parameter", alternative.gives, table.parameters)
    free = [name for name, own in table.coordinates.items() if own.prescribed_by is None]
    known = [*free, *map(rate_name, free), *table.states]
    prescribed = [name for name in table.coordinates if name not in free]
    for name in table.initial:
        if name in table.states and table.states[name].start is not None:
            why = f"has two start values: states.{name}.start gives it too; remove one"
        elif name in known:
            continue
        elif name in (*prescribed, *map(rate_name, prescribed)):
            why = "is prescribed by an input, which also gives its start value; remove it"
        else:
            why = f"is not a coordinate, rate or state.{nearest(name, known)} Known: {_listed(known)}"
        declaration.refuse(("initial", name), f"'{name}' {why}")


def check_names_read(declaration: Declaration) -> None:
    """Refuse names that an expression cannot read."""
    for path, expression in declaration.expressions.items():
        allowed, said = _allowed(declaration, path)
        for name, place in expression.reads.items():
            if name not in allowed:
                declaration.refuse(path, _why_not(declaration, name, allowed, said), place)


def _allowed(declaration: Declaration, path: Path) -> tuple[set[str], str]:
    """Return what an expression may read, and the same in words."""
    names = declaration.names
    numbers, motion = names("constants", "parameters"), names("coordinates")
    rates = set(map(rate_name, motion))
    everything = numbers | motion | rates | names("inputs", "states", "signals", "drives", "sensors")
    match path:
        case ("joints", _, "motion"):
            return numbers | motion, f"the motion of a joint may contain coordinates, {_NUMBERS}"
        case ("drives", _, "along"):
            said = "the expression along which a force acts may contain coordinates"
            return numbers | motion, f"{said}, {_NUMBERS}"
        case ("energy", kind):
            read, said = (
                (motion | rates, "coordinates, rates") if kind == "kinetic" else (motion, "coordinates")
            )
            readable = _with_signals(declaration, numbers | read)
            return readable, f"a {kind} energy may contain {said}, {_NUMBERS}, and signals made of these"
        case ("joints", _, "force"):
            said = f"the force of a joint may contain coordinates, rates, states, signals, {_NUMBERS}"
            return numbers | motion | rates | names("states", "signals"), said
        case ("joints", _, part):
            return numbers, f"the {part} of a joint may contain {_NUMBERS}"
        case ("initial", _) | ("states", _, "start"):
            return numbers, f"a start value may contain {_NUMBERS}"
        case ("alternatives", name, _):
            return names("constants") | {str(name)}, f"the derived value may contain '{name}' and constants"
        case ("sensors", _, _):
            return everything | set(map(force_name, names("joints"))), ""
        case _:
            return everything, ""


def _with_signals(declaration: Declaration, readable: set[str]) -> set[str]:
    """Return names with those of the signals that are made of nothing else, directly or through other signals."""
    reads = {
        name: declaration.expressions["signals", name].reads.keys() for name in declaration.table.signals
    }
    found = set(readable)
    while made := {name for name, read in reads.items() if read <= found} - found:
        found |= made
    return found


def _why_not(declaration: Declaration, name: str, allowed: set[str], said: str) -> str:
    """Return why an expression cannot read a name, and what to write."""
    table = declaration.table
    inner = name.partition("(")[2].removesuffix(")")
    if name in declaration.symbols:
        if inner in table.joints and name == force_name(inner):
            return (
                f"'{name}' can only be read by sensors: the force of a joint can be recorded but not fed back"
            )
        if name in table.alternatives:
            return f"'{name}' is an alternative to '{table.alternatives[name].gives}'; use that one"
        return f"'{name}' cannot be read here: {said}"
    if name == force_name(inner):
        return f"there is no joint '{inner}'.{nearest(inner, table.joints)} Joints: {_listed(table.joints)}"
    if inner:
        return (
            f"'{name}' is a rate, and there is no coordinate '{inner}'.{nearest(inner, table.coordinates)} "
            f"Coordinates: {_listed(table.coordinates)}"
        )
    rate = next(
        (r for r in map(rate_name, table.coordinates) if name == r.replace("(", "").replace(")", "")), None
    )
    meant = nearest(name, allowed) if rate is None else f" Did you mean '{rate}'?"
    declare = f"[parameters.{name}] to identify it, [constants.{name}] if it is known"
    return f"'{name}' is not declared.{meant} {'Or declare' if meant else 'Declare'} it: {declare}"


def check_all_used(declaration: Declaration) -> None:
    """Refuse what no equation reads: it would be ignored."""
    table, expressions = declaration.table, declaration.expressions
    read = {name for expression in expressions.values() for name in expression.reads}
    if table.simulator is not None:
        read |= set(table.simulator.parameters)
    read |= {own.prescribed_by for own in table.coordinates.values() if own.prescribed_by is not None}
    for key in ("inputs", "constants", "parameters", "signals"):
        for name in getattr(table, key):
            if name not in read:
                declaration.refuse((key, name), f"no equation reads '{name}'; remove it, or use it")
    for name in table.drives:
        # The force may follow from a state that the drive moves: a current, a pressure.
        if not any(name in e.reads for path, e in expressions.items() if path != ("drives", name, "signal")):
            declaration.refuse(
                ("drives", name, "force"),
                f"neither it nor another equation reads '{name}', the signal of the drive after its effects; use '{name}' in it",
            )
    for name in table.alternatives:
        path = ("alternatives", name, "value")
        if name not in expressions[path].reads:
            declaration.refuse(path, f"it does not read '{name}', from which it should be derived")


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"
