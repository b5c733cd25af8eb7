"""Names of the parts of a MuJoCo model in a rig file: its own names as unique identifiers."""

from __future__ import annotations

import re

from rigsight.rigs.reading.functions import FUNCTIONS

_LONGEST = 40
"""Characters of a part's name; what is made of it has more."""


class Names:
    """Gives names that no other part has."""

    def __init__(self) -> None:
        self._taken = {*FUNCTIONS, "t", "d", "force"}

    def free(self, wished: str, otherwise: str = "part") -> str:
        """Return the requested name if it is valid and free, or a similar one."""
        name = re.sub(r"\W+", "_", wished, flags=re.ASCII).strip("_")[:_LONGEST] or otherwise
        name = name if not name[0].isdigit() else f"{otherwise}_{name}"
        found, count = name, 1
        while found in self._taken:
            count += 1
            found = f"{name}_{count}"
        self._taken.add(found)
        return found
