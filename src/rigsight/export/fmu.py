"""How does a model become an FMU: for co-simulation by FMI 2.0 or 3.0, with its sources and a binary for this machine?"""

from __future__ import annotations

import io
import platform
import uuid
import zipfile
from collections.abc import Mapping
from importlib.resources import files
from typing import Literal

from rigsight.errors import InputError
from rigsight.export.c_source import c_source
from rigsight.export.description import filled, hold_text
from rigsight.export.equations import Exported
from rigsight.export.fmu_description import build_description, interpolates, model_description
from rigsight.libraries.compiler import first_library, library_suffix
from rigsight.libraries.library_cache import OPTIONS

Version = Literal[2, 3]

_SYSTEMS = {"Linux": "linux", "Darwin": "darwin", "Windows": "windows"}
_PROCESSORS = {
    "x86_64": "x86_64",
    "AMD64": "x86_64",
    "aarch64": "aarch64",
    "arm64": "aarch64",
    "ARM64": "aarch64",
}
_NAMESPACE = uuid.UUID("0a4b5d0e-2f0f-5a53-9d5e-6f1c2a7e9b31")
_FIRST_DAY = (1980, 1, 1, 0, 0, 0)
_INTERPOLATED: Mapping[Version, str] = {
    2: "Set the first derivatives of the inputs for it; without them they are constant.",
    3: "Set the inputs that end in _slope for it; at zero the others are constant.",
}
_CONSTANT = "Derivatives of the inputs are not read."


def fmu(
    exported: Exported, source: str, name: str, *, version: Version = 2, source_only: bool = False
) -> bytes:
    """Return the bytes of an FMU; the same model gives the same bytes with the same compiler."""
    model = c_source(exported, source, name)
    guid = f"{{{uuid.uuid5(_NAMESPACE, model)}}}"
    fragments = {
        "TITLE": exported.title,
        "HOLD_TEXT": hold_text(exported),
        "INTERPOLATION": _INTERPOLATED[version] if interpolates(exported) else _CONSTANT,
        "N_SLOPES": "N_IN" if interpolates(exported) else "0",
        "GUID": guid,
        "UPPER": name.upper(),
        "NAME": name,
    }
    wrapper = filled(_template(f"fmi{version}.c.txt"), {"UNIT": _template("fmi.c.txt"), **fragments})
    sources = {f"fmi{version}_{name}.c": wrapper, f"{name}.c": model}
    members: dict[str, str | bytes] = {
        "modelDescription.xml": model_description(exported, source, name, guid, version),
        **{f"sources/{file}": text for file, text in sources.items()},
    }
    if version == 3:
        members["sources/buildDescription.xml"] = build_description(name)
    if not source_only:
        members[f"binaries/{_folder(version)}/{name}{library_suffix()}"] = _binary(sources)
    return _zipped(members)


def _template(name: str) -> str:
    return files("rigsight.export").joinpath("templates", name).read_text("utf-8")


def _binary(sources: Mapping[str, str]) -> bytes:
    """Return the library, for every processor of this machine's kind: an FMU is carried elsewhere."""
    try:
        return first_library(sources, OPTIONS)[1]
    except InputError as error:
        raise type(error)(
            f"{error} Or write an FMU with source code only, which the importing tool compiles: --source-only."
        ) from error


def _folder(version: Version) -> str:
    """Return where the standard looks for the binary of this machine."""
    system, machine = platform.system(), platform.machine()
    if version == 2:
        return {"Linux": "linux64", "Darwin": "darwin64", "Windows": "win64"}.get(system, system)
    return f"{_PROCESSORS.get(machine, machine)}-{_SYSTEMS.get(system, system)}"


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
