"""Cache of the compiled kernels of structures."""

from __future__ import annotations

import hashlib
import threading

from rigsight.libraries import is_kept, library_file
from rigsight.simulate.compiled.kernel import Kernel
from rigsight.simulate.compiled.kernel_source import kernel_source
from rigsight.simulate.compiled.simulated_bodies import include_folders
from rigsight.simulate.equations.structure import Structure

_kernels: dict[str, Kernel] = {}
_by_identity: dict[int, tuple[Structure, str]] = {}
_texts: dict[int, tuple[Structure, str]] = {}
"""C texts of structures whose kernel is not loaded yet; printing a text takes some 20 ms."""
_lock = threading.Lock()
_made: dict[str, threading.Lock] = {}
"""A lock for each kernel, so that it is compiled only once while others may be compiled at the same time."""


def kernel_of(structure: Structure) -> Kernel:
    """Return the compiled kernels of a structure, compiling them if this machine has not yet done so.

    Raises
    ------
    InputError
        If there is no C compiler.
    MachineError
        If the cache folder cannot be written, or the compiler fails.
    """
    known = _loaded(structure)
    if known is not None:
        return known
    with _lock:
        known = _loaded(structure)
        if known is not None:
            return known
        # Threads write texts one after the other, which is no slower in pure Python. The compilers run in parallel.
        text = _text(structure)
        key = hashlib.sha256(text.encode()).hexdigest()
        own = _made.setdefault(key, threading.Lock())
    with own:
        if key not in _kernels:
            _kernels[key] = Kernel(library_file(text, include_folders(structure)), structure)
        _by_identity[id(structure)] = (structure, key)
        _texts.pop(id(structure), None)
        return _kernels[key]


def _loaded(structure: Structure) -> Kernel | None:
    known = _by_identity.get(id(structure))
    return _kernels.get(known[1]) if known is not None and known[0] is structure else None


def compiled(structure: Structure) -> bool:
    """Return True if the machine code of a structure's kernels is loaded or in the cache."""
    if _loaded(structure) is not None:
        return True
    text = _text(structure)
    return is_kept(text)


def _text(structure: Structure) -> str:
    known = _texts.get(id(structure))
    if known is None or known[0] is not structure:
        known = _texts[id(structure)] = (structure, kernel_source(structure))
    return known[1]
