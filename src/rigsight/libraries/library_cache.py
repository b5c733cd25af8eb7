"""Cache of libraries on disk, under the hash of everything on which the machine code depends.

A stale library is impossible, because its name is the hash of its C source, the compiler, its options and the processor. A
damaged one is detected by a checksum before it is loaded, and rebuilt.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from rigsight.errors import InputError, MachineError
from rigsight.libraries.compiler import Compiler, c_compilers, first_library, library_suffix

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
_CHECKSUM_SIZE = 64


def cache_folder() -> Path:
    """Return the folder of compiled kernels: $RIGSIGHT_CACHE_DIR, else the platform's cache folder of the user.

    Raises
    ------
    InputError
        If the variable is not set and there is no home folder.
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
        # A container with a numeric user without a name.
        raise InputError(
            f"There is no home folder for the cache of compiled kernels. Set {CACHE_VARIABLE} to a writable folder."
        ) from None


def library_file(text: str, included: Sequence[str] = ()) -> Path:
    """Return an intact library of a C text, of the first compiler for which one is cached or can be compiled.

    Parameters
    ----------
    text
        C, which is a library by itself.
    included
        Folders of headers that are not the compiler's.

    Raises
    ------
    InputError
        If there is no C compiler.
    MachineError
        If the cache folder cannot be written, or the compiler fails.
    """
    for compiler in c_compilers():
        path = _path(text, compiler)
        if _sound(path):
            return path
    compiler, content = first_library(
        {"kernel.c": text}, (*kernel_options(), *(f"-I{folder}" for folder in included))
    )
    path = _path(text, compiler)
    _write(path, content)
    return path


def is_kept(text: str) -> bool:
    """Return True if an intact library of a C text is already cached."""
    return any(_sound(_path(text, compiler)) for compiler in c_compilers())


def kernel_options() -> tuple[str, ...]:
    """Return the compiler options of kernels on this machine."""
    own = _OWN_PROCESSOR.get(platform.machine())
    return (*OPTIONS, *((own,) if own else ()), *os.environ.get(FLAGS_VARIABLE, "").split())


def _path(text: str, compiler: Compiler) -> Path:
    parts = (text, " ".join(compiler.command), compiler.identity, " ".join(kernel_options()), processor())
    name = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]
    return cache_folder() / f"{name}{library_suffix()}"


@cache
def processor() -> str:
    """Return an identifier that distinguishes this processor from others that cannot run its code."""
    reported = f"{platform.machine()} {platform.processor()}"
    with contextlib.suppress(OSError):
        first = Path("/proc/cpuinfo").read_text("utf-8", errors="replace").partition("\n\n")[0]
        names = (
            "vendor_id",
            "cpu family",
            "model",
            "model name",
            "stepping",
            "flags",
            "Features",
            "CPU part",
        )
        lines = [line for line in first.splitlines() if line.partition(":")[0].strip() in names]
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
