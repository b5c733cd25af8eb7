"""Which temporary files hold results on their way to the disk, and which of them did a killed run leave?

A file on its way to ``NAME`` is ``.NAME.TOKEN.part``, what it replaces waits as ``.NAME.TOKEN.old`` until all are in place. Both
are locked as long as their writer lives, so that a later run removes what a killed one left, and nothing else.
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
    # Windows: nothing can be told about a writer there, so nothing is removed.
    fcntl = None

_TEMPORARY = re.compile(r"\.[0-9a-f]{8}\.(part|old)")


def temporary_path(target: Path, token: str, ending: str) -> Path:
    """Return where content on its way to a file, or the file's old content, waits; `ending` is ``part`` or ``old``."""
    return target.with_name(f".{target.name}.{token}.{ending}")


def write_locked(path: Path, content: bytes) -> IO[bytes]:
    """Write a new file and return it open, locked as long as it is.

    Raises
    ------
    OSError
        If it cannot be written.
    """
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
    """Give a file a second name, or copy it where a file has only one; return it open, locked as long as it is.

    Raises
    ------
    OSError
        If the disk does not take it.
    """
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
    """Remove what killed runs left of a file on its way."""
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
        # A file system without locks takes results all the same.
        with contextlib.suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
