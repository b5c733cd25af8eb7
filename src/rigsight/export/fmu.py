"""How does a model become an FMU: FMI 2.0 for co-simulation, with its sources and a binary for this machine?"""

from __future__ import annotations

import errno
import io
import os
import platform
import shutil
import signal
import subprocess
import tempfile
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

from rigsight.errors import InputError
from rigsight.export.c_source import c_source
from rigsight.export.description import filled, hold_text
from rigsight.export.equations import Exported
from rigsight.export.fmu_description import interpolates, model_description

_COMPILERS = ("cc", "gcc", "clang")
_BINARIES = {
    "Linux": ("linux64", ".so", ["-shared", "-fPIC", "-fvisibility=hidden"]),
    "Darwin": ("darwin64", ".dylib", ["-dynamiclib", "-fPIC", "-fvisibility=hidden"]),
    "Windows": ("win64", ".dll", ["-shared"]),
}
_ROOM = 1_000_000
"""What a compiler needs for its files [bytes]; with less left, the disk is what failed."""
_NAMESPACE = uuid.UUID("0a4b5d0e-2f0f-5a53-9d5e-6f1c2a7e9b31")
_FIRST_DAY = (1980, 1, 1, 0, 0, 0)
_INTERPOLATED = "Set the first derivatives of the inputs for it; without them they are constant."
_CONSTANT = "Derivatives of the inputs are not read."


def fmu(exported: Exported, source: str, name: str, *, source_only: bool = False) -> bytes:
    """Return the bytes of an FMU; the same model gives the same bytes with the same compiler.

    Parameters
    ----------
    exported
        The model.
    source
        The file it comes from.
    name
        Identifier of the model.
    source_only
        True for sources without a binary.

    Raises
    ------
    InputError
        If there is no C compiler, or it fails.
    OSError
        If there is no room for the compiler's files.
    """
    model = c_source(exported, source, name)
    template = files("rigsight.export").joinpath("templates/fmi2.c.txt").read_text("utf-8")
    guid = f"{{{uuid.uuid5(_NAMESPACE, model)}}}"
    wrapper = filled(
        template,
        {
            "TITLE": exported.title,
            "HOLD_TEXT": hold_text(exported),
            "INTERPOLATION": _INTERPOLATED if interpolates(exported) else _CONSTANT,
            "GUID": guid,
            "UPPER": name.upper(),
            "NAME": name,
        },
    )
    sources = {f"fmi2_{name}.c": wrapper, f"{name}.c": model}
    members: dict[str, str | bytes] = {
        "modelDescription.xml": model_description(exported, source, name, guid),
        **{f"sources/{file}": text for file, text in sources.items()},
    }
    if not source_only:
        folder, suffix, binary = _compiled(sources, name)
        members[f"binaries/{folder}/{name}{suffix}"] = binary
    return _zipped(members)


def c_compiler() -> str | None:
    """Return the C compiler of this machine: the one that the variable CC names, or the first that is found."""
    for candidate in (os.environ.get("CC", ""), *_COMPILERS):
        found = shutil.which(candidate) if candidate else None
        if found:
            return found
    return None


def _compiled(sources: Mapping[str, str], name: str) -> tuple[str, str, bytes]:
    compiler, system = c_compiler(), platform.system()
    if compiler is None or system not in _BINARIES:
        lacks = "No C compiler was found" if compiler is None else f"No binary can be made for {system}"
        raise InputError(
            f"{lacks}, and an FMU holds a binary. Install one (Debian: apt-get install gcc), name it in the variable CC, or "
            "write an FMU with sources alone, which the importing tool compiles: --source-only."
        )
    folder, suffix, options = _BINARIES[system]
    with tempfile.TemporaryDirectory(prefix="rigsight-") as place:
        for file, text in sources.items():
            Path(place, file).write_text(text, encoding="utf-8")
        target = Path(place, f"{name}{suffix}")
        command = [compiler, "-O2", "-std=c99", *options, "-o", target.name, f"fmi2_{name}.c", "-lm"]
        code, said = _run(command, place)
        if code != 0 or not target.is_file():
            if shutil.disk_usage(place).free < _ROOM:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), place)
            first = next(iter(said.strip().splitlines()), "no message")
            raise InputError(
                f"The C compiler {compiler} failed: {first}. Name another one in the variable CC, or write --source-only."
            )
        return folder, suffix, target.read_bytes()


def _run(command: Sequence[str], place: str) -> tuple[int, str]:
    """Run a compiler in a folder that holds its own temporary files too; return its exit code and what it said.

    It runs programs of its own, which end with it when we are interrupted.
    """
    temporary = dict.fromkeys(("TMPDIR", "TMP", "TEMP"), place)
    with subprocess.Popen(
        command,
        cwd=place,
        env={**os.environ, **temporary},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            _, said = process.communicate()
        except BaseException:
            if os.name == "nt":
                process.kill()
            else:
                os.killpg(process.pid, signal.SIGKILL)
            raise
        return process.returncode, said


def _zipped(members: Mapping[str, str | bytes]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            # The time of day would make every file another one.
            entry = zipfile.ZipInfo(name, _FIRST_DAY)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content)
    return file.getvalue()
