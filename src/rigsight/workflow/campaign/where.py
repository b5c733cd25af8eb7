"""The location of an error in messages: file, line and key, or the title of a campaign in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rigsight.rigs.reading.toml_places import Place, value_places

LISTS = ("records", "withheld")
"""Keys that hold lists of records."""

Location = tuple[str | int, ...]


@dataclass(frozen=True)
class Where:
    """The locations of keys."""

    name: str  # the file, or the name of a campaign in memory
    # The contents of the file, so that a record can be named by its file.
    data: Mapping[str, Any] = field(default_factory=dict)
    # Line and column of each value by its keys; empty if unknown.
    places: Mapping[Location, Place] = field(default_factory=dict)

    @classmethod
    def of_toml(cls, name: str, text: str, data: Mapping[str, Any]) -> Where:
        """Return the locations of the keys of a TOML file."""
        return cls(name, data, value_places(text))

    def at(self, *location: str | int) -> str:
        """Return the beginning of a message: ``campaign.toml, line 7, column 5: rig.constants.v``."""
        return f"{self.name}{self._place(location)}: {self.called(location)}"

    def called(self, location: Location) -> str:
        """Return a location as text: ``rig.constants.v``, ``record 2 (step.csv): role``."""
        if len(location) < 2 or location[0] not in LISTS or not isinstance(location[1], int):
            return ".".join(map(str, location))
        listed = self.data.get(location[0])
        table = (
            listed[location[1]] if isinstance(listed, list | tuple) and len(listed) > location[1] else None
        )
        file = table.get("file") if isinstance(table, dict) else None
        record = f"record {location[1] + 1}" + (f" ({file})" if isinstance(file, str) and file else "")
        rest = ".".join(map(str, location[2:]))
        return f"{record}: {rest}" if rest else record

    def _place(self, location: Location) -> str:
        """Return the line of a key; for a missing key, the line of its table."""
        for length in range(len(location), 0, -1):
            own = location[:length]
            place = self.places.get(own) or next(
                (inner for key, inner in self.places.items() if key[:length] == own), None
            )
            if place is not None:
                return f", line {place[0]}, column {place[1]}"
        return ""
