"""Bodies of a rig file that another program simulates, with their names there."""

from __future__ import annotations

import contextlib
from pathlib import Path

from rigsight.errors import InputError, nearest
from rigsight.rigs.reading.declaration import Declaration
from rigsight.simulators import KINDS, Bodies
from rigsight.simulators.bodies import model_digest

_KEY = "simulator"
_OWNERS = {"states": "mujoco", "rates": "fmu", "forces": "fmu", "step": "fmu", "without_armature": "mujoco"}
"""Keys that one kind of simulator alone has."""


def check_simulator(declaration: Declaration) -> None:
    """Refuse a simulator of an unknown kind, and names in its table that are not declared."""
    table, own = declaration.table, declaration.table.simulator
    if own is None:
        return
    if own.kind not in KINDS:
        allowed = f"{nearest(own.kind, KINDS)} Allowed: {', '.join(KINDS)}"
        declaration.refuse((_KEY, "kind"), f"'{own.kind}' is not a simulator.{allowed}")
    free = [name for name, coordinate in table.coordinates.items() if coordinate.prescribed_by is None]
    if len(free) < len(table.coordinates) or not free:
        declaration.refuse(
            (_KEY,), "every coordinate of a simulated rig must be a degree of freedom; remove prescribed_by"
        )
    for key, wanted in _OWNERS.items():
        if getattr(own, key) and own.kind != wanted:
            declaration.refuse((_KEY, key), f"it belongs to {wanted}, but this is {own.kind}; remove it")
    if own.digest and own.kind == "python":
        declaration.refuse(
            (_KEY, "digest"), "it is of a model's file, and a Python function has none; remove it"
        )
    for key in ("coordinates", "rates", "forces"):
        for name in getattr(own, key):
            declaration.check_known((_KEY, key, name), "coordinate", name, free)
        names = list(getattr(own, key).values())
        for name, there in getattr(own, key).items():
            if names.count(there) > 1:
                declaration.refuse((_KEY, key, name), f"'{there}' is used twice; each needs its own")
    for name, there in own.parameters.items():
        if list(own.parameters.values()).count(there) > 1:
            declaration.refuse((_KEY, "parameters", name), f"'{there}' is given by two numbers; remove one")
    for name in own.states:
        declaration.check_known((_KEY, "states", name), "state", name, table.states)
    numbers = declaration.names("constants", "parameters")
    for name in own.parameters:
        if name not in numbers:
            why = f"is neither a constant nor a parameter of this file.{nearest(name, numbers)} Declare it"
            declaration.refuse((_KEY, "parameters", name), f"'{name}' {why}")


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
        declaration.refuse((_KEY, "file"), str(error).removesuffix("."))
    return bodies


def with_whole_path(content: dict[str, object], folder: Path) -> dict[str, object]:
    """Return the tables of a rig file with the simulator's model by its absolute path, so that results find it."""
    own = content.get(_KEY)
    if not isinstance(own, dict) or own.get("kind") == "python" or not isinstance(own.get("file"), str):
        return content
    # What is wrong with the file is told with its place, once the tables are read.
    with contextlib.suppress(ValueError):
        own = {**own, "file": (folder / str(own["file"])).resolve().as_posix()}
    with contextlib.suppress(InputError):
        # A digest that stands there is kept: a model of another content is then refused.
        own = {"digest": model_digest(str(own.get("kind")), Path(str(own["file"]))), **own}
    return {**content, _KEY: own}
