"""Temporary files of results that are being written, and removal of those that a killed run left.

A file that becomes ``NAME`` is first ``.NAME.TOKEN.part``; the old file is kept as ``.NAME.TOKEN.old`` until all are in place.
Both are locked while their writer lives, so that a later run removes only what a killed one left.
"""

from __future__ import annotations

import contextlib
import re
import shutil
from pathlib import Path
from types import ModuleType
from typing import IO

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:
    # Windows: whether the writer lives cannot be determined, so nothing is removed.
    fcntl = None

_TEMPORARY = re.compile(r"\.[0-9a-f]{8}\.(part|old)")


def temporary_path(target: Path, token: str, ending: str) -> Path:
    """Return the temporary path of the new or old content of a file; `ending` is ``part`` or ``old``."""
    return target.with_name(f".{target.name}.{token}.{ending}")


def write_locked(path: Path, content: bytes) -> IO[bytes]:
    """Write a new file and return it open; it is locked while it is open."""
    file = path.open("xb")
    try:
        _lock(file)
        file.write(content)
        file.flush()
    except BaseException:
        file.close()
        raise
    return file


def keep_locked(target: Path, path: Path) -> IO[bytes]:
    """Give a file a second hard link, or copy it where that is not possible; return it open and locked."""
    try:
        path.hardlink_to(target)
    except (OSError, NotImplementedError):
        try:
            shutil.copy2(target, path)
        except BaseException:
            path.unlink(missing_ok=True)
            raise
    try:
        file = path.open("rb")
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    _lock(file)
    return file


def remove_left(target: Path) -> None:
    """Remove temporary files of a result that killed runs left."""
    if fcntl is None:
        return
    with contextlib.suppress(OSError):
        for path in target.parent.iterdir():
            name = path.name
            if name.startswith(f".{target.name}.") and _TEMPORARY.fullmatch(name[len(target.name) + 1 :]):
                _remove_if_left(path)


def _remove_if_left(path: Path) -> None:
    assert fcntl is not None
    with contextlib.suppress(OSError), path.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        path.unlink()


def _lock(file: IO[bytes]) -> None:
    if fcntl is not None:
        # Results are written also on file systems without locks.
        with contextlib.suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
