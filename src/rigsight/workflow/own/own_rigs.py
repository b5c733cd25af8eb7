"""Find rigs by name: the built-in ones, and those of a user's own rig files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from rigsight.errors import InputError
from rigsight.rigs import RIGS, Rig, read_rig_file


def own_rigs(files: Iterable[str | Path]) -> dict[Path, Rig]:
    """Return the rigs that files declare."""
    found: dict[Path, Rig] = {}
    taken = dict.fromkeys(RIGS, "a built-in rig")
    for path in {Path(file).resolve(): Path(file) for file in files}.values():
        rig = read_rig_file(path)
        if rig.name in taken:
            raise InputError(
                f"{path}: name: '{rig.name}' is the name of {taken[rig.name]}; give the rig another name."
            )
        taken[rig.name] = f"the rig of {path}"
        found[path] = rig
    return found


def known_rigs(own: Iterable[Rig] = ()) -> Mapping[str, Rig]:
    """Return all rigs by name."""
    return {**RIGS, **{rig.name: rig for rig in own}}
