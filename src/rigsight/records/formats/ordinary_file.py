"""Check for a regular file (not a device or pipe), so that reading it ends."""

from __future__ import annotations

import stat
from pathlib import Path

from rigsight.errors import InputError


def file_size(path: Path, what: str = "the file") -> int:
    """Return the size of a file in bytes."""
    try:
        found = path.stat()
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; check the path.") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "this is not a file name"
        raise InputError(f"{path} cannot be read: {reason}.") from None
    if stat.S_ISDIR(found.st_mode):
        raise InputError(f"{path} is a folder; name {what} in it.")
    if not stat.S_ISREG(found.st_mode):
        raise InputError(
            f"{path} is a device or a pipe, not a regular file; save its contents as a file first."
        )
    return found.st_size
