"""Compiling kernels ahead of use."""

from __future__ import annotations

from rigsight.simulate.compiled.kernel_cache import compiled as compiled
from rigsight.simulate.compiled.kernel_cache import kernel_of
from rigsight.simulate.equations.structure import Structure


def compile_kernels(structure: Structure) -> None:
    """Compile the kernels of a structure and keep them on disk."""
    kernel_of(structure)
