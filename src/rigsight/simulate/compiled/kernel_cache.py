"""Cache of the compiled kernels of structures."""

from __future__ import annotations

import hashlib
import threading

from rigsight.libraries import is_kept, library_file
from rigsight.simulate.compiled.kernel import Kernel
from rigsight.simulate.compiled.kernel_source import include_folders, kernel_source
from rigsight.simulate.equations.structure import Structure

_kernels: dict[str, Kernel] = {}
_keys: dict[Structure, str] = {}
_texts: dict[Structure, str] = {}
"""C texts of structures whose kernel is not loaded yet; printing a text takes some 20 ms."""
_lock = threading.Lock()
_made: dict[str, threading.Lock] = {}
"""A lock for each kernel, so that it is compiled only once while others may be compiled at the same time."""


def kernel_of(structure: Structure) -> Kernel:
    """Return the compiled kernels of a structure, compiling them if this machine has not yet done so."""
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
        _keys[structure] = key
        _texts.pop(structure, None)
        return _kernels[key]


def _loaded(structure: Structure) -> Kernel | None:
    key = _keys.get(structure)
    return None if key is None else _kernels.get(key)


def compiled(structure: Structure) -> bool:
    """Return True if the machine code of a structure's kernels is loaded or in the cache."""
    if _loaded(structure) is not None:
        return True
    text = _text(structure)
    return is_kept(text)


def _text(structure: Structure) -> str:
    text = _texts.get(structure)
    if text is None:
        text = _texts[structure] = kernel_source(structure)
    return text


def compile_kernels(structure: Structure) -> None:
    """Compile the kernels of a structure and keep them on disk."""
    kernel_of(structure)
