"""Published parameter sets of rigs, each with its source."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from rigsight.effects import effect_named
from rigsight.errors import InputError, check_option
from rigsight.parameters import complete_values
from rigsight.rigs import RIGS
from rigsight.rigs.built_in import tables_in

_KEYS = ("title", "source", "rig", "amplitude", "notes", "constants", "parameters", "effects")


@dataclass(frozen=True)
class PublishedSet:
    """A published parameter set."""

    name: str  # name of its file without the ending
    title: str  # what it is, one line
    source: str  # publication and table
    rig: str
    constants: Mapping[str, float]  # value of each constant of the rig
    parameters: Mapping[str, float]  # value of each parameter of the rig
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  # effect -> its parameter values
    # Values as the source prints them, where it gives an alternative parameter (conicity instead of creep
    # factor).
    given: Mapping[str, float] = field(default_factory=dict)
    # Amplitude of the input the set was fitted at, None if it claims to hold at every one.
    amplitude: float | None = None
    notes: str = ""  # what to know before using it

    def values(self) -> dict[str, float]:
        """Return all values by name, as a simulation of the rig with these effects takes them."""
        merged = {**self.constants, **self.parameters}
        for own in self.effects.values():
            merged.update(own)
        return merged


@cache
def published_sets() -> Mapping[str, PublishedSet]:
    """Return the published sets by name, in alphabetical order."""
    found = tables_in("parameter_sets").items()
    return {name: parse_published_set(name, file.read_text("utf-8")) for name, file in found}


def parse_published_set(name: str, text: str) -> PublishedSet:
    """Read a published set from TOML."""
    try:
        content = tomllib.loads(text)
        for key in content:
            check_option("Key", key, _KEYS)
        missing = [key for key in ("title", "source", "rig", "constants", "parameters") if key not in content]
        if missing:
            raise InputError(f"Missing: {', '.join(missing)}.")
        return _checked(name, content)
    except (tomllib.TOMLDecodeError, InputError) as error:
        raise InputError(f"Parameter set '{name}': {error}") from error


def _checked(name: str, content: dict[str, Any]) -> PublishedSet:
    rig = RIGS[check_option("rig", content["rig"], RIGS)]
    constants = complete_values(rig.constants, content["constants"])
    alternatives = {p.name: p for p in rig.alternative_parameters}
    own = dict(content["parameters"])
    given = {key: alternatives[key].check(own.pop(key)) for key in [*own] if key in alternatives}
    own |= rig.in_own_parameters(given, constants)
    return PublishedSet(
        name=name,
        title=str(content["title"]),
        source=str(content["source"]),
        rig=rig.name,
        constants=constants,
        parameters=complete_values(rig.parameters, own),
        effects={
            effect: complete_values(effect_named(effect).parameters, values)
            for effect, values in content.get("effects", {}).items()
        },
        given=given,
        amplitude=content.get("amplitude"),
        notes=str(content.get("notes", "")),
    )
