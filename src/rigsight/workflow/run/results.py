"""Write result files, all of them completely or none."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import secrets
import shutil
import signal
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextvars import ContextVar
from pathlib import Path
from types import ModuleType
from typing import IO, Any

from rigsight.errors import InputError, MachineError

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:
    # Windows: whether the writer lives cannot be determined, so nothing is removed.
    fcntl = None
_TEMPORARY = re.compile(r"\.[0-9a-f]{8}\.(part|old)")


_REASONS = {
    errno.EACCES: "no permission to write there",
    errno.EPERM: "no permission to write there",
    errno.EROFS: "the file system is read-only",
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.ENAMETOOLONG: "the name is too long",
    errno.ENOENT: "its parent folder does not exist and cannot be created",
}
ENDING_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""Ctrl-C, kill, and a closed terminal."""
DIAGNOSIS_FILE, REPORT_FILE = "diagnosis.json", "report.html"
"""Results of a diagnosis; the bench reads one and links the other."""
ELSEWHERE = "Name another place with --out."

_noted: ContextVar[list[Path] | None] = ContextVar("folders with results", default=None)


@contextlib.contextmanager
def noting_folders() -> Iterator[Sequence[Path]]:
    """Collect the folders into which results are written inside this block, for the message after an interruption."""
    folders: list[Path] = []
    before = _noted.set(folders)
    try:
        yield folders
    finally:
        _noted.reset(before)


def json_text(content: Mapping[str, Any]) -> str:
    """Return content as indented JSON in its own order, with a final line end."""
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def check_writable(folder: Path, *names: str) -> None:
    """Check before long work that results can be written into a folder, which may not exist yet."""
    existing = folder.absolute()
    try:
        while not existing.exists():
            if existing.is_symlink():
                raise InputError(
                    f"Cannot write results to {folder}: {existing} is a link to {existing.readlink()}, which does not exist. "
                    "Name another folder, or remove the link."
                )
            existing = existing.parent
        if not existing.is_dir():
            raise InputError(f"Cannot write results to {folder}: {existing} is a file. Name another folder.")
        with signals_held():
            Path(tempfile.mkdtemp(prefix=".rigsight-", dir=existing)).rmdir()
        for name in names:
            _check_replaceable(folder / name)
    except OSError as error:
        raise _reported(folder, error) from None


def check_target(file: Path) -> None:
    """Check before long work that one result file can be written or replaced."""
    check_writable(file.parent)
    _check_replaceable(file)


def write_together(
    folder: Path, contents: Mapping[str, str | bytes], remedy: str = ELSEWHERE
) -> tuple[Path, ...]:
    """Write files into a folder, all of them or none; files of these names are replaced.

    Even after Ctrl-C or kill, the folder contains all old files or all new ones. Only SIGKILL during the final renaming can leave
    a mixture. Temporary files of such a run are removed by the next one.
    """
    # Links are kept; the files to which they point are replaced.
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
                # Commands and notes quote names of files, which need not be text.
                raw = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
                file = write_locked(part, raw)
                locks.callback(file.close)
                os.fsync(file.fileno())
                if os.name == "nt":
                    # An open file cannot be renamed there.
                    file.close()
            with signals_held() as held:
                _put_in_place(parts, token, held)
                is_in_place = True
                if (folders := _noted.get()) is not None:
                    folders.append(folder)
    except BaseException as error:
        if is_in_place:
            # A deferred signal that arrived after everything was done.
            raise
        with signals_held(), contextlib.suppress(OSError):
            for path in parts.values():
                path.unlink(missing_ok=True)
            for path in reversed(made):
                # Another process may have put a file there meanwhile.
                if path.is_dir() and not any(path.iterdir()):
                    path.rmdir()
        if isinstance(error, OSError):
            raise _reported(folder, error, remedy) from None
        raise
    return tuple(folder / name for name in contents)


def _put_in_place(parts: Mapping[Path, Path], token: str, held: Sequence[int]) -> None:
    """Rename finished files to their final names; if that fails or a signal is waiting, restore the old files."""
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
                # The message after the interruption says that nothing was written.
                raise KeyboardInterrupt
        except BaseException:
            for path in fresh:
                path.unlink(missing_ok=True)
            for target, old in kept.items():
                old.replace(target)
            raise
        finally:
            # Renaming one hard link of a file to another would do nothing.
            for old in kept.values():
                # All files are in place; the next run removes what remains here.
                with contextlib.suppress(OSError):
                    old.unlink(missing_ok=True)


@contextlib.contextmanager
def signals_held() -> Iterator[Sequence[int]]:
    """Defer Ctrl-C and termination signals until this context ends; the result lists those that are waiting."""
    held: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        # Only the main thread receives signals.
        yield held
        return
    before = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
    # Handlers that were not set from Python cannot be restored; ignored signals stay ignored.
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
    """Create a folder with its parents; new ones are appended to the list, outermost first, before they are created."""
    for path in reversed([path for path in (folder, *folder.parents) if not path.exists()]):
        made.append(path)
        path.mkdir(exist_ok=True)


def _check_replaceable(file: Path) -> None:
    """Refuse targets that must not be replaced by a file: folders, and devices such as /dev/stdout."""
    if file.is_dir():
        raise InputError(f"Cannot write {file}: it is a folder. Name a file, or remove the folder.")
    if file.exists() and not file.is_file():
        raise InputError(f"Cannot write {file}: it is a device or a pipe, not a regular file. Name a file.")


def _reported(folder: Path, error: OSError, remedy: str = ELSEWHERE) -> InputError:
    if isinstance(error, FileExistsError | NotADirectoryError):
        return InputError(f"Cannot write results to {folder}: a file is in the way. Name another folder.")
    reason = _REASONS.get(error.errno or 0, error.strerror or str(error))
    return MachineError(f"Cannot write results to {folder}: {reason}. {remedy}")


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
