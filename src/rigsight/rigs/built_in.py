"""The rigs that come with the package: files of the same form as a user's own, read when they are first asked for."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from types import MappingProxyType
from typing import Any

from rigsight.rigs.reading.rig_file import rig_of_tables, rig_of_text
from rigsight.rigs.rig import Rig


class KnownRigs(Mapping[str, Rig]):
    """Name -> rig: the built-in ones, then others."""

    def __init__(self, others: Mapping[str, Rig] = MappingProxyType({})) -> None:
        self._others = others

    def __getitem__(self, name: str) -> Rig:
        if name in self._others:
            return self._others[name]
        if name not in _files():
            raise KeyError(name)
        return _rig(name)

    def __iter__(self) -> Iterator[str]:
        return iter({**dict.fromkeys(_files()), **dict.fromkeys(self._others)})

    def __len__(self) -> int:
        return len({*_files(), *self._others})


RIGS = KnownRigs()


def declared_rig(name: str, declaration: Mapping[str, Any], source: str = "declaration") -> Rig | None:
    """Return the rig of a model or a result: the one that it declares, else a built-in one, None where there is neither."""
    # Results that were written before rigs were carried along declare none.
    built_in = RIGS.get(name)
    if not declaration or (built_in is not None and built_in.declaration == declaration):
        return built_in
    turning = None if built_in is None else rotational(built_in)
    if turning is not None and turning.declaration == declaration:
        return turning
    return rig_of_tables(declaration, source)


def rig_file_text(name: str) -> str:
    """Return the file of a rig that comes with the package."""
    return _files()[name].read_text("utf-8")


@cache
def tables_in(folder: str) -> Mapping[str, Traversable]:
    """Return the files in TOML of a folder of this package by name, in alphabetical order."""
    found = sorted(files("rigsight.rigs").joinpath(folder).iterdir(), key=lambda file: file.name)
    return {file.name.removesuffix(".toml"): file for file in found if file.name.endswith(".toml")}


def _files() -> Mapping[str, Traversable]:
    return tables_in("files")


@cache
def _rig(name: str) -> Rig:
    # Their units are checked by the tests: the library that knows units takes a second to load.
    return rig_of_text(rig_file_text(name), f"{name}.toml", check_units=False)


_NAMED = {"AXIS": "axis", "ELEMENT": "element", "RUNNING_GEAR": "running_gear"}
"""Constants of this package: one moving mass with a drive, a force element on a bench, the running gear of the thesis."""


def __getattr__(name: str) -> Rig:
    """Return a rig by its constant; to read all of them at once would delay every command."""
    if name in _NAMED:
        return RIGS[_NAMED[name]]
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


_TURNED = ("axis", "element")

_TURNING = {"m": "rad", "N": "N m", "kg": "kg m^2"}
"""Units of a motion along a line -> those of one about an axis."""


def rotational(rig: Rig) -> Rig | None:
    """Return `AXIS` or `ELEMENT` with an angle for its displacement and a torque for its force; None for any other rig."""
    return _rotational(rig.name) if rig.name in _TURNED and rig is RIGS[rig.name] else None


@cache
def _rotational(name: str) -> Rig:
    def turned(unit: re.Match[str]) -> str:
        return re.sub(r"\b(?:m|N|kg)\b", lambda base: _TURNING[base[0]], unit[0])

    text = re.sub(r'(?<=unit = ")[^"]*', turned, rig_file_text(name))
    return rig_of_text(text, f"{name}.toml", check_units=False)
