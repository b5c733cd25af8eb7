"""How result files reach the disk: whole and together, or not at all."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rigsight.errors import InputError

_REASONS = {
    errno.EACCES: "writing is not allowed there",
    errno.EPERM: "writing is not allowed there",
    errno.EROFS: "the file system is read-only",
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.ENAMETOOLONG: "the name is too long",
    errno.ENOENT: "the folder above it does not exist and cannot be made",
}


def json_text(content: Mapping[str, Any]) -> str:
    """Return content as JSON in the order it was put together in, readable and with a line end.

    Raises
    ------
    ValueError
        If a number is not finite: JSON has no word for it.
    """
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def check_writable(folder: Path) -> None:
    """Find out before long work whether results can be written into a folder, which may not exist yet.

    Raises
    ------
    InputError
        If a file is in the way or the folder cannot be made or written.
    """
    existing = folder.absolute()
    while not existing.exists():
        existing = existing.parent
    if not existing.is_dir():
        raise InputError(f"Cannot write results to {folder}: {existing} is a file. Name another folder.")
    try:
        Path(tempfile.mkdtemp(prefix=".rigsight-", dir=existing)).rmdir()
    except OSError as error:
        raise _told(folder, error) from None


def check_target(file: Path) -> None:
    """Find out before long work whether one result file can be written, or replaced.

    Raises
    ------
    InputError
        If the name belongs to something that is no file, or its folder cannot be written.
    """
    check_writable(file.parent)
    _check_replaceable(file)


def write_together(folder: Path, contents: Mapping[str, str | bytes]) -> tuple[Path, ...]:
    """Write files into a folder, all of them or none; files of these names are replaced.

    Parameters
    ----------
    folder
        Made, with the folders above it, if it does not exist.
    contents
        File name -> text, or bytes of a picture.

    Returns
    -------
    The files written, in order.

    Raises
    ------
    InputError
        If the folder cannot be made or written, something is in the way, or the disk is full.
    """
    made: list[Path] = []
    parts: dict[Path, Path] = {}
    fresh: list[Path] = []
    try:
        made = _made(folder)
        for name, content in contents.items():
            target = folder / name
            _check_replaceable(target)
            # A link keeps pointing where it does; what it points to is replaced.
            target = target.resolve()
            part = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
            parts[part] = target
            with part.open("xb") as file:
                file.write(content.encode("utf-8") if isinstance(content, str) else content)
                file.flush()
                os.fsync(file.fileno())
        for part, target in parts.items():
            if not target.exists():
                fresh.append(target)
            part.replace(target)
    except BaseException as error:
        for path in (*parts, *fresh):
            path.unlink(missing_ok=True)
        for path in reversed(made):
            # Somebody else may have put a file there meanwhile.
            if path.is_dir() and not any(path.iterdir()):
                path.rmdir()
        if isinstance(error, OSError):
            raise _told(folder, error) from None
        raise
    return tuple(folder / name for name in contents)


@contextlib.contextmanager
def removed_on_failure(folder: Path) -> Iterator[None]:
    """Remove a folder, with the folders above it, that was made inside this context if the work in it fails."""
    new = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        yield
    except BaseException:
        if folder in new:
            shutil.rmtree(folder, ignore_errors=True)
        for path in new[1:]:
            if path.is_dir() and not any(path.iterdir()):
                path.rmdir()
        raise


def _made(folder: Path) -> list[Path]:
    """Make a folder with those above it and return the new ones, outermost first."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    made = []
    try:
        for path in reversed(missing):
            path.mkdir(exist_ok=True)
            made.append(path)
    except BaseException:
        for path in reversed(made):
            path.rmdir()
        raise
    return made


def _check_replaceable(file: Path) -> None:
    """Refuse what must not be replaced by a file: folders, and devices such as /dev/stdout."""
    if file.is_dir():
        raise InputError(f"Cannot write {file}: it is a folder. Name a file, or remove the folder.")
    if file.exists() and not file.is_file():
        raise InputError(f"Cannot write {file}: it is no ordinary file. Name a file.")


def _told(folder: Path, error: OSError) -> InputError:
    if isinstance(error, FileExistsError | NotADirectoryError):
        return InputError(f"Cannot write results to {folder}: a file is in the way. Name another folder.")
    reason = _REASONS.get(error.errno or 0, error.strerror or str(error))
    return InputError(f"Cannot write results to {folder}: {reason}. Name another place with --out.")
