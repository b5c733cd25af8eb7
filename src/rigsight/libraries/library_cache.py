"""Libraries of C source: built by a compiler of this machine, and kept under the hash of everything they depend on.

A stale library is impossible, because its name is the hash of its C source, the compiler, its options and the processor. A
damaged one is detected by a checksum before it is loaded, and rebuilt.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

from rigsight.errors import InputError, MachineError

VARIABLE = "CC"
_COMMON = ("cc", "gcc", "clang")
_ROOM = 1_000_000
"""Disk space that a compiler needs [bytes]; with less, a failure is attributed to the disk."""
_SHARED = {
    "Linux": (".so", ("-shared", "-fPIC", "-fvisibility=hidden")),
    "Darwin": (".dylib", ("-dynamiclib", "-fPIC", "-fvisibility=hidden")),
    "Windows": (".dll", ("-shared",)),
}
NO_COMPILER = (
    "No C compiler was found, which simulations need. Install one: 'pip install rigsight[compiler]' (without root), or on "
    f"Debian 'apt-get install gcc', or name one in the environment variable {VARIABLE}."
)

_CACHES = {"win32": ("LOCALAPPDATA", "AppData/Local"), "darwin": ("", "Library/Caches")}
"""Platform -> the variable that names the folder of caches, and where it is at home without one."""
CACHE_VARIABLE = "RIGSIGHT_CACHE_DIR"
FLAGS_VARIABLE = "RIGSIGHT_CFLAGS"
"""Options that follow those of the engine and so replace them, to see whether a result depends on them: ``-O1``."""
# The source vectorizes explicitly; automatic vectorization of the few states of one parameter set costs a third of the speed.
# No options that assume finite values or reorder sums: overflow must be detected, and results may differ between compilers by
# rounding only.
OPTIONS = (
    "-std=gnu11", "-O3", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math", "-fno-tree-vectorize",
    "-fno-tree-slp-vectorize", "-w",
)  # fmt: skip
"""Options of every compiled model; kernels, which stay on this machine, add the features of its processor."""
_OWN_PROCESSOR = {
    "x86_64": "-march=native",
    "AMD64": "-march=native",
    "aarch64": "-mcpu=native",
    "arm64": "-mcpu=native",
}
_OF_PROCESSOR = (
    "vendor_id",
    "cpu family",
    "model",
    "model name",
    "stepping",
    "flags",
    "Features",
    "CPU part",
)
_CHECKSUM_SIZE = 64


@dataclass(frozen=True)
class Compiler:
    """A C compiler."""

    command: tuple[str, ...]  # program and arguments that stand before all others
    identity: str  # what changes when the program does: its path, size and time of change

    @property
    def name(self) -> str:
        """The command as text."""
        return shlex.join(self.command)


def c_compilers() -> tuple[Compiler, ...]:
    """Return the C compilers of this machine, best first: the one that the variable CC names alone, or all that are found."""
    return _found(os.environ.get(VARIABLE, ""), os.environ.get("PATH", ""))


@lru_cache(maxsize=8)
def _found(named: str, path: str) -> tuple[Compiler, ...]:
    if named.strip():
        try:
            words = shlex.split(named)
        except ValueError as error:
            raise InputError(f"The variable {VARIABLE} is not a command ({error}): {named!r}.") from None
        program = shutil.which(words[0], path=path)
        if program is None:
            raise InputError(
                f"The variable {VARIABLE} names '{words[0]}', which was not found. Name a C compiler there, or unset it."
            )
        return (Compiler((program, *words[1:]), _identity(program)),)
    programs = dict.fromkeys(shutil.which(name, path=path) for name in _COMMON)
    found = [Compiler((program,), _identity(program)) for program in programs if program is not None]
    zig = importlib.util.find_spec("ziglang")
    if zig is not None and zig.origin is not None:
        found.append(Compiler((sys.executable, "-m", "ziglang", "cc"), _identity(zig.origin)))
    return tuple(found)


def _identity(program: str) -> str:
    real = Path(program).resolve()
    try:
        status = real.stat()
    except OSError:
        return str(real)
    return f"{real} {status.st_size} {status.st_mtime_ns}"


def library_suffix() -> str:
    """Return the suffix of a shared library on this system."""
    return _system()[0]


def _system() -> tuple[str, tuple[str, ...]]:
    system = platform.system()
    if system not in _SHARED:
        raise InputError(f"Libraries cannot be built for {system}; rigsight runs on {', '.join(_SHARED)}.")
    return _SHARED[system]


def first_library(sources: Mapping[str, str], flags: Sequence[str]) -> tuple[Compiler, bytes]:
    """Return a shared library and the first of this machine's compilers that can make it."""
    failed: MachineError | None = None
    for compiler in c_compilers():
        try:
            return compiler, library(compiler, sources, flags)
        except MachineError as error:
            failed = failed or error
    raise failed or InputError(NO_COMPILER)


def library(compiler: Compiler, sources: Mapping[str, str], flags: Sequence[str]) -> bytes:
    """Return the bytes of a shared library; the same text gives the same bytes with the same compiler."""
    suffix, shared = _system()
    try:
        with tempfile.TemporaryDirectory(prefix="rigsight-", ignore_cleanup_errors=True) as place:
            for file, text in sources.items():
                Path(place, file).write_text(text, encoding="utf-8")
            target = Path(place, f"library{suffix}")
            # By default zig writes the path of the build folder for debuggers, so that the bytes differ each time.
            options = ("-g0", *flags, *shared)
            command = [*compiler.command, *options, "-o", target.name, next(iter(sources)), "-lm"]
            code, said = _run(command, place)
            if code == 0 and target.is_file():
                return target.read_bytes()
            if shutil.disk_usage(place).free < _ROOM:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), place)
            lines = (line for line in said.splitlines() if "error" in line)
            first = next(lines, said.strip() or "no message")
    except OSError as error:
        raise MachineError(
            f"The C compiler {compiler.name} cannot be run in {tempfile.gettempdir()} ({error.strerror or error}). "
            "Free some space there, or set TMPDIR to a folder with enough space."
        ) from error
    raise MachineError(
        f"The C compiler {compiler.name} failed: {first.strip()}. "
        f"Name another one in the variable {VARIABLE}, or install 'rigsight[compiler]'."
    )


def _run(command: Sequence[str], place: str) -> tuple[int, str]:
    """Run a compiler in a folder that holds its own temporary files too; return its exit code and output."""
    # It runs programs of its own, which end with it when we are interrupted.
    with subprocess.Popen(
        command,
        cwd=place,
        env={**os.environ, **dict.fromkeys(("TMPDIR", "TMP", "TEMP"), place)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
    ) as process:
        try:
            _, said = process.communicate()
        except BaseException:
            if os.name == "nt":
                process.kill()
            else:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
            raise
    return process.returncode, said


def cache_folder() -> Path:
    """Return the folder of compiled kernels: $RIGSIGHT_CACHE_DIR, else the platform's cache folder of the user."""
    chosen = os.environ.get(CACHE_VARIABLE)
    if chosen:
        return Path(chosen)
    variable, inside = _CACHES.get(sys.platform, ("XDG_CACHE_HOME", ".cache"))
    base = os.environ.get(variable)
    try:
        return (Path(base) if base else Path.home() / inside) / "rigsight" / "kernels"
    except RuntimeError:
        # A container with a numeric user without a name.
        raise InputError(
            f"There is no home folder for the cache of compiled kernels. Set {CACHE_VARIABLE} to a writable folder."
        ) from None


def library_file(text: str, included: Sequence[str] = ()) -> Path:
    """Return an intact library of a C text, of the first compiler for which one is cached or can be compiled.

    A machine without a compiler takes one that any compiler made. The folders hold headers that are not the compiler's.
    """
    kept = _kept(text)
    if kept is not None:
        return kept
    compiler, content = first_library(
        {"kernel.c": text}, (*kernel_options(), *(f"-I{folder}" for folder in included))
    )
    path = _path(text, compiler)
    _write(path, content)
    return path


def is_kept(text: str) -> bool:
    """Return True if an intact library of a C text is already cached."""
    return _kept(text) is not None


def _kept(text: str) -> Path | None:
    compilers = c_compilers()
    paths = [_path(text, compiler) for compiler in compilers]
    if not compilers:
        paths = sorted(cache_folder().glob(f"{_name(text)}-*{library_suffix()}"))
    return next(filter(_sound, paths), None)


def kernel_options() -> tuple[str, ...]:
    """Return the compiler options of kernels on this machine."""
    own = _OWN_PROCESSOR.get(platform.machine())
    return (*OPTIONS, *((own,) if own else ()), *os.environ.get(FLAGS_VARIABLE, "").split())


def _path(text: str, compiler: Compiler) -> Path:
    made_by = _digest(" ".join(compiler.command), compiler.identity)
    return cache_folder() / f"{_name(text)}-{made_by}{library_suffix()}"


def _name(text: str) -> str:
    """Return the part of a library's name that does not depend on its compiler."""
    return _digest(text, " ".join(kernel_options()), processor())


def _digest(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]


@cache
def processor() -> str:
    """Return an identifier that distinguishes this processor from others that cannot run its code."""
    reported = f"{platform.machine()} {platform.processor()}"
    with contextlib.suppress(OSError):
        first = Path("/proc/cpuinfo").read_text("utf-8", errors="replace").partition("\n\n")[0]
        lines = [line for line in first.splitlines() if line.partition(":")[0].strip() in _OF_PROCESSOR]
        reported = "\n".join([reported, *lines])
    return reported


def _sound(path: Path) -> bool:
    """Return True for a complete library: loading an incomplete one would crash the process."""
    try:
        content = path.read_bytes()
    except OSError:
        return False
    body, checksum = content[:-_CHECKSUM_SIZE], content[-_CHECKSUM_SIZE:]
    return hashlib.sha256(body).hexdigest().encode() == checksum


def _write(path: Path, content: bytes) -> None:
    """Write a library completely or not at all; its checksum is appended, where loaders ignore it."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.write(hashlib.sha256(content).hexdigest().encode())
            Path(part).replace(path)
        except BaseException:
            Path(part).unlink(missing_ok=True)
            raise
    except OSError as error:
        # Another process was faster and has loaded it; on some systems it then cannot be replaced.
        if _sound(path):
            return
        raise MachineError(
            f"Cannot write compiled kernels to {path.parent} ({error.strerror}). Set {CACHE_VARIABLE} to a writable folder."
        ) from error
