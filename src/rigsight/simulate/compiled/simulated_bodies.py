"""Quantities computed by another simulator, as C functions that the equations call."""

from __future__ import annotations

import ctypes

from rigsight.libraries.templates import template
from rigsight.simulate.equations.structure import Structure


def bodies_text(structure: Structure) -> str:
    """Return the C text of a structure's simulated bodies; empty if there are none."""
    bodies = structure.rig.mechanism.bodies
    return "" if bodies is None else bodies.c_text


def lane_bodies_text(structure: Structure) -> str:
    """Return the same for parameter sets side by side."""
    if structure.rig.mechanism.bodies is None:
        return ""
    return template("simulators", "lane_simulated.c.txt")


def include_folders(structure: Structure) -> tuple[str, ...]:
    """Return the folders of the headers that `bodies_text` includes."""
    bodies = structure.rig.mechanism.bodies
    return () if bodies is None else bodies.program.include_folders


def connect(structure: Structure, library: ctypes.CDLL) -> None:
    """Give a loaded kernel the functions by which it calls another simulator."""
    bodies = structure.rig.mechanism.bodies
    if bodies is not None:
        bodies.program.connect(library)
