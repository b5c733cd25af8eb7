"""Write result files, all of them completely or none."""

from __future__ import annotations

import contextlib
import errno
import io
import json
import platform
import signal
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigsight.errors import InputError, MachineError, check_option

if TYPE_CHECKING:
    from rigsight.records import Record

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
_VERSIONS_OF = ("rigsight", "numpy", "scipy")
ELSEWHERE = "Name another place with --out."
_DIGITS = 12
_STAMPS_TO = 1e-4
"""Of the sample time: how closely time is written, so that the file is evenly sampled when it is read again."""

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


def versions() -> dict[str, str]:
    """Return the versions of these packages, by name."""
    found = {"python": platform.python_version()}
    for package in _VERSIONS_OF:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


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
    """Write files into a folder, all of them or none; files of these names are replaced."""
    # They are written under temporary names, which a later run replaces if this one is killed; a signal that comes while they get
    # their own names waits for that.
    made: list[Path] = []
    parts: dict[Path, Path] = {}
    try:
        for name, content in contents.items():
            _make((folder / name).parent, made)
            _check_replaceable(folder / name)
            # Links are kept; the files to which they point are replaced.
            target = (folder / name).resolve()
            part = parts[target] = target.with_name(f".{target.name}.part")
            # Commands and notes quote names of files, which need not be text.
            part.write_bytes(
                content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
            )
        with signals_held():
            for target, part in parts.items():
                part.replace(target)
            if (folders := _noted.get()) is not None:
                folders.append(folder)
    except BaseException as error:
        with contextlib.suppress(OSError):
            for part in parts.values():
                part.unlink(missing_ok=True)
            for path in reversed(made):
                if path.is_dir() and not any(path.iterdir()):
                    path.rmdir()
        if isinstance(error, OSError):
            raise _reported(folder, error, remedy) from None
        raise
    return tuple(folder / name for name in contents)


@contextlib.contextmanager
def signals_held() -> Iterator[None]:
    """Defer Ctrl-C and termination signals until this context ends."""
    held: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        # Only the main thread receives signals.
        yield
        return
    before = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
    # Handlers that were not set from Python cannot be restored; ignored signals stay ignored.
    before = {number: old for number, old in before.items() if old not in (None, signal.SIG_IGN)}
    for number in before:
        signal.signal(number, lambda number, _: held.append(number))
    try:
        yield
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


def write_picture(file: Path, draw: Callable[[str], str | bytes]) -> Path:
    """Write what is drawn for the suffix of a file, once it is clear that the file can be written."""
    suffix = check_option("The suffix of a picture", file.suffix.lower(), (".png", ".svg"))
    check_target(file)
    return write_together(file.parent, {file.name: draw(suffix)})[0]


def csv_text(record: Record, names: Sequence[str]) -> str:
    """Return the time and the named signals of a record, under their names, as a CSV file that can be read again."""
    # Loaded where it is used: the command line imports this module at its start.
    import numpy as np

    from rigsight.records.read_record import TIME
    from rigsight.records.stamps import digits_for

    table = np.column_stack([record.t, *(record[name] for name in names)])
    digits = [digits_for(float(record.t[-1]), _STAMPS_TO * record.dt, _DIGITS), *[_DIGITS] * len(names)]
    formats, heads = [f"%.{n}g" for n in digits], ",".join([TIME, *names])
    file = io.StringIO()
    np.savetxt(file, table, fmt=formats, delimiter=",", header=heads, comments="")
    return file.getvalue()
