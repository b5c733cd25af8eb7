"""In which order can signals, drives and sensors be evaluated? Each reads only those in front of it."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter

from rigsight.rigs.parts import READING
from rigsight.rigs.reading.declaration import Declaration, Path


def signal_order(declaration: Declaration) -> list[Path]:
    """Return the paths of signals, drives and sensors so that each reads only those in front of it."""
    table = declaration.table
    own: dict[str, Path] = {
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
