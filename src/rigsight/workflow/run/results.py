"""How result files reach the disk: whole and together, or not at all."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import secrets
import signal
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from rigsight.errors import InputError, MachineError
from rigsight.workflow.run.unfinished_files import keep_locked, remove_left, temporary_path, write_locked

_REASONS = {
    errno.EACCES: "writing is not allowed there",
    errno.EPERM: "writing is not allowed there",
    errno.EROFS: "the file system is read-only",
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.ENAMETOOLONG: "the name is too long",
    errno.ENOENT: "the folder above it does not exist and cannot be made",
}
ENDING_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""Ctrl-C, kill, and a terminal that goes away."""
DIAGNOSIS_FILE, REPORT_FILE = "diagnosis.json", "report.html"
"""Results of a diagnosis; the bench reads one and links the other."""
ELSEWHERE = "Name another place with --out."

_noted: ContextVar[list[Path] | None] = ContextVar("folders with results", default=None)


@contextlib.contextmanager
def noting_folders() -> Iterator[Sequence[Path]]:
    """Give the folders into which results are written inside this block, for who says what is there when it is interrupted."""
    folders: list[Path] = []
    before = _noted.set(folders)
    try:
        yield folders
    finally:
        _noted.reset(before)


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
    try:
        while not existing.exists():
            existing = existing.parent
        if not existing.is_dir():
            raise InputError(f"Cannot write results to {folder}: {existing} is a file. Name another folder.")
        with signals_held():
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


def write_together(
    folder: Path, contents: Mapping[str, str | bytes], mend: str = ELSEWHERE
) -> tuple[Path, ...]:
    """Write files into a folder, all of them or none; files of these names are replaced.

    Whatever ends it, Ctrl-C and kill included, the folder holds all old files or all new ones; only a process that is killed
    outright while the finished files are given their names can leave some of each. What such a one left is removed.

    Parameters
    ----------
    folder
        Made, with the folders above it, if it does not exist.
    contents
        File name, or path inside the folder -> text, or bytes of a picture.
    mend
        What can be done where the folder cannot be written, for the message.

    Returns
    -------
    The files written, in order.

    Raises
    ------
    InputError
        If the folder cannot be made or written, something is in the way, or the disk is full.
    """
    # Links keep pointing where they do; what they point to is replaced.
    token = secrets.token_hex(4)
    made: list[Path] = []
    parts: dict[Path, Path] = {}
    is_in_place = False
    try:
        with contextlib.ExitStack() as locks:
            for name, content in contents.items():
                _make((folder / name).parent, made)
                _check_replaceable(folder / name)
                target = (folder / name).resolve()
                remove_left(target)
                part = parts[target] = temporary_path(target, token, "part")
                file = write_locked(part, content.encode("utf-8") if isinstance(content, str) else content)
                locks.callback(file.close)
                os.fsync(file.fileno())
                if os.name == "nt":
                    # An open file cannot be given another name there.
                    file.close()
            with signals_held() as held:
                _put_in_place(parts, token, held)
                is_in_place = True
                if (folders := _noted.get()) is not None:
                    folders.append(folder)
    except BaseException as error:
        if is_in_place:
            # A signal that waited; it came when all was done.
            raise
        with signals_held(), contextlib.suppress(OSError):
            for path in parts.values():
                path.unlink(missing_ok=True)
            for path in reversed(made):
                # Somebody else may have put a file there meanwhile.
                if path.is_dir() and not any(path.iterdir()):
                    path.rmdir()
        if isinstance(error, OSError):
            raise _told(folder, error, mend) from None
        raise
    return tuple(folder / name for name in contents)


def _put_in_place(parts: Mapping[Path, Path], token: str, held: Sequence[int]) -> None:
    """Give finished files their names; if one cannot have it, or a signal waits, the old files are back at theirs."""
    kept: dict[Path, Path] = {}
    fresh: list[Path] = []
    with contextlib.ExitStack() as locks:
        try:
            for target in parts:
                if target.exists():
                    old = temporary_path(target, token, "old")
                    locks.callback(keep_locked(target, old).close)
                    kept[target] = old
                else:
                    fresh.append(target)
            for target, part in parts.items():
                part.replace(target)
            if held:
                # Who interrupts is told that nothing was written.
                raise KeyboardInterrupt
        except BaseException:
            for path in fresh:
                path.unlink(missing_ok=True)
            for target, old in kept.items():
                old.replace(target)
            raise
        finally:
            # Two names of one file stay two when one is to replace the other.
            for old in kept.values():
                # All is in place; the next run removes what is left here.
                with contextlib.suppress(OSError):
                    old.unlink(missing_ok=True)


@contextlib.contextmanager
def signals_held() -> Iterator[Sequence[int]]:
    """Let Ctrl-C and requests to end wait until this context is left; those that wait are listed."""
    held: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        # Signals reach the main thread alone.
        yield held
        return
    before = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
    # What was not set from Python cannot be set again; what is ignored stays so.
    before = {number: old for number, old in before.items() if old not in (None, signal.SIG_IGN)}
    for number in before:
        signal.signal(number, lambda number, _: held.append(number))
    try:
        yield held
    finally:
        for number, old in before.items():
            signal.signal(number, old)
        for number in held[:1]:
            signal.raise_signal(number)


def _make(folder: Path, made: list[Path]) -> None:
    """Make a folder with those above it; the new ones are appended, outermost first, each before it is made."""
    for path in reversed([path for path in (folder, *folder.parents) if not path.exists()]):
        made.append(path)
        path.mkdir(exist_ok=True)


def _check_replaceable(file: Path) -> None:
    """Refuse what must not be replaced by a file: folders, and devices such as /dev/stdout."""
    if file.is_dir():
        raise InputError(f"Cannot write {file}: it is a folder. Name a file, or remove the folder.")
    if file.exists() and not file.is_file():
        raise InputError(f"Cannot write {file}: it is a device or a pipe, not a regular file. Name a file.")


def _told(folder: Path, error: OSError, mend: str = ELSEWHERE) -> InputError:
    if isinstance(error, FileExistsError | NotADirectoryError):
        return InputError(f"Cannot write results to {folder}: a file is in the way. Name another folder.")
    reason = _REASONS.get(error.errno or 0, error.strerror or str(error))
    return MachineError(f"Cannot write results to {folder}: {reason}. {mend}")
