"""What are parameters and states called inside a function of an export that has names of its own?"""

from __future__ import annotations

from collections.abc import Set

from rigsight.export.equations import Exported


def local_names(exported: Exported, own: Set[str]) -> dict[str, str]:
    """Return what each parameter and state is called: as in the export, or one like it where the function needs that name.

    Others see the names of the export, so that a name used inside costs nobody his own.
    """
    names = [quantity.name for quantity in (*exported.parameters, *exported.states)]
    taken, found = {*names, *own}, {}
    for name in names:
        found[name] = name
        while found[name] in own or (found[name] != name and found[name] in taken):
            found[name] += "_"
        taken.add(found[name])
    return found
