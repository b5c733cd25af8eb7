"""Source text of a kernel -> compiled module, cached on disk under the hash of that text.

A stale kernel is impossible: the file's name is the hash of all that its machine code depends on in our hands (its complete
source), its text is compared before use, and numba keys its own cache on that file, its own version and the processor.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from rigsight.errors import InputError, MachineError
from rigsight.simulate.kernel_source import kernel_source
from rigsight.simulate.structure import Structure

CACHE_VARIABLE = "RIGSIGHT_CACHE_DIR"
ENTRY_POINTS = ("simulate_one", "simulate_lanes")
"""Functions of a kernel module that are called from outside it."""

_modules: dict[str, ModuleType] = {}
_lock = threading.RLock()


def cache_folder() -> Path:
    """Return where compiled kernels live: $RIGSIGHT_CACHE_DIR, else the platform's place for a user's caches.

    Raises
    ------
    InputError
        If the variable is not set and nobody knows a home folder.
    """
    chosen = os.environ.get(CACHE_VARIABLE)
    if chosen:
        return Path(chosen)
    name = {"win32": "LOCALAPPDATA", "darwin": ""}.get(sys.platform, "XDG_CACHE_HOME")
    base = os.environ.get(name)
    return (Path(base) if base else _caches_at_home()) / "rigsight" / "kernels"


def _caches_at_home() -> Path:
    inside = {"win32": "AppData/Local", "darwin": "Library/Caches"}.get(sys.platform, ".cache")
    try:
        return Path.home() / inside
    except RuntimeError:
        # A container that runs under a number without a name.
        raise InputError(
            f"There is no home folder to keep compiled kernels in. Set {CACHE_VARIABLE} to a folder that can be written."
        ) from None


def kernels(structure: Structure) -> Any:
    """Return the module of compiled kernels of a structure, generating and loading it if needed.

    Raises
    ------
    InputError
        If the cache folder cannot be written.
    """
    with _lock:
        key = id(structure)
        source = _sources_by_identity.get(key)
        if source is None or source[0] is not structure:
            source = (structure, kernel_source(structure))
            _sources_by_identity[key] = source
        text = source[1]
        name = f"rigsight_kernel_{hashlib.sha256(text.encode()).hexdigest()[:24]}"
        module = _modules.get(name)
        if module is None:
            module = _load(name, _written(name, text))
            _modules[name] = module
        return module


def run_kernel(structure: Structure, function: str, *arguments: Any) -> Any:
    """Call a function of a structure's kernels, compiling it if this machine has not yet done so.

    Raises
    ------
    InputError
        If the cache folder cannot be written.
    """
    module = kernels(structure)
    try:
        return getattr(module, function)(*arguments)
    except (TypeError, AttributeError):
        raise
    # Kernels raise nothing themselves: what arrives here is machine code on disk that is damaged or cannot be written.
    except Exception as error:
        path = Path(str(module.__file__))
        try:
            for file in (path.parent / "__pycache__").glob(f"{path.stem}.*"):
                file.unlink()
            with _lock:
                _modules[path.stem] = _load(path.stem, path)
            return getattr(_modules[path.stem], function)(*arguments)
        except Exception:
            raise MachineError(
                f"Cannot use the compiled kernels in {path.parent} ({error}). "
                f"Remove that folder, or set {CACHE_VARIABLE} to one that can be written."
            ) from error


_sources_by_identity: dict[int, tuple[Structure, str]] = {}
_listings: dict[Path, tuple[int, dict[str, list[str]]]] = {}


def compiled(structure: Structure, functions: Sequence[str] = ENTRY_POINTS) -> bool:
    """Return True if this machine seems to hold the machine code of these functions of a structure's kernels already.

    A hint: code of another processor or numba version is only found out, and compiled anew, when it is called.
    """
    path = Path(str(kernels(structure).__file__))
    version = f".py{sys.version_info.major}{sys.version_info.minor}"
    names = _machine_code(path.parent / "__pycache__")
    return all(
        any(
            name.startswith(f"{path.stem}.{function}-") and version in name
            for name in names.get(path.stem, ())
        )
        for function in functions
    )


def _machine_code(folder: Path) -> dict[str, list[str]]:
    """Return the names of the index files of machine code by module; a folder that has not changed is listed once."""
    try:
        changed = folder.stat().st_mtime_ns
    except OSError:
        return {}
    known = _listings.get(folder)
    if known is None or known[0] != changed:
        found: dict[str, list[str]] = {}
        for file in folder.iterdir():
            if file.suffix == ".nbi":
                found.setdefault(file.name.partition(".")[0], []).append(file.name)
        known = _listings[folder] = (changed, found)
    return known[1]


def _written(name: str, text: str) -> Path:
    """Return the file that holds `text`, written whole or not at all."""
    folder = cache_folder()
    path = folder / f"{name}.py"
    try:
        if path.is_file() and path.read_text("utf-8") == text:
            return path
        folder.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=folder, suffix=".tmp")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
            Path(part).replace(path)
        except BaseException:
            Path(part).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise MachineError(
            f"Cannot keep compiled kernels in {folder} ({error.strerror}). "
            f"Set {CACHE_VARIABLE} to a folder that can be written."
        ) from error
    return path


def _load(name: str, path: Path) -> ModuleType:
    specification = importlib.util.spec_from_file_location(name, path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module
    try:
        specification.loader.exec_module(module)
    except RuntimeError as error:
        # numba's word for a folder in which it may not put machine code.
        if "cannot cache" not in str(error):
            raise
        del sys.modules[name]
        raise MachineError(
            f"Cannot keep compiled kernels in {path.parent} (it cannot be written). "
            f"Set {CACHE_VARIABLE} to a folder that can be written."
        ) from error
    return module
