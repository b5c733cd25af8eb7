"""How does a model become an FMU: for co-simulation by FMI 2.0 or 3.0, with its sources and a binary for this machine?"""

from __future__ import annotations

import io
import platform
import uuid
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal
from xml.etree import ElementTree as ET

from rigsight.errors import InputError
from rigsight.export.c_source import c_source
from rigsight.export.description import equation_lines, hold_text, made_by
from rigsight.export.equations import Exported
from rigsight.libraries.library_cache import OPTIONS, first_library, library_suffix
from rigsight.libraries.templates import filled, template

_NO_UNIT = "1"
Version = Literal[2, 3]

_SYSTEMS = {"Linux": "linux", "Darwin": "darwin", "Windows": "windows"}
_PROCESSORS = {"AMD64": "x86_64", "arm64": "aarch64", "ARM64": "aarch64"}
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
    unit = {"UNIT": template("export", "fmi.c.txt")}
    wrapper = filled(template("export", f"fmi{version}.c.txt"), unit | fragments)
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


@dataclass(frozen=True)
class _Variable:
    """A variable of an FMU; references count from 0 in the order in which variables are listed."""

    name: str
    unit: str
    description: str
    causality: Literal["input", "output", "parameter", "independent"]
    variability: str = "continuous"
    initial: str | None = None
    start: float | None = None


def interpolates(exported: Exported) -> bool:
    """Return True if derivatives of the inputs are of use within a communication step."""
    return bool(exported.sources) and (exported.follows_motion or exported.hold == "foh")


def model_description(exported: Exported, source: str, name: str, guid: str, version: Version = 2) -> str:
    """Return the text of the description."""
    variables = _unique(_variables(exported, version))
    root = ET.Element("fmiModelDescription", fmiVersion=f"{version}.0", modelName=name)
    root.set("guid" if version == 2 else "instantiationToken", guid)
    step = f"A communication step is a sample: {hold_text(exported)}."
    root.set("description", f"{exported.title}. {step} {'; '.join(equation_lines(exported))}")
    root.set("generationTool", made_by(source).removeprefix("Made by "))
    root.set("variableNamingConvention", "flat")
    if version == 2:
        root.set("numberOfEventIndicators", "0")
    # A model that remembers samples needs them equally far apart.
    remembers = exported.structure.delay is not None or exported.structure.first_shown_late is not None
    can = {"canHandleVariableCommunicationStepSize": _truth(not remembers)}
    if version == 2:
        can |= {"canInterpolateInputs": _truth(interpolates(exported)), "canGetAndSetFMUstate": "true"}
        can |= {"canNotUseMemoryManagementFunctions": "true"}
    else:
        can |= {"canGetAndSetFMUState": "true"}
    simulation = ET.SubElement(root, "CoSimulation", {"modelIdentifier": name, **can})
    if version == 2:
        ET.SubElement(ET.SubElement(simulation, "SourceFiles"), "File", name=f"fmi2_{name}.c")
    units = ET.SubElement(root, "UnitDefinitions")
    for unit in sorted({variable.unit for variable in variables}):
        ET.SubElement(units, "Unit", name=unit)
    listed = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        _add(listed, reference, variable, version)
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [i for i, variable in enumerate(variables) if variable.causality == "output"]
    for kind in ("Output", "InitialUnknown"):
        unknowns = structure if version == 3 else ET.SubElement(structure, f"{kind}s")
        for index in outputs:
            if version == 3:
                ET.SubElement(unknowns, kind, valueReference=str(index))
            else:
                ET.SubElement(unknowns, "Unknown", index=str(index + 1))
    return _text(root)


def build_description(name: str) -> str:
    """Return how the sources of an FMI 3.0 FMU are compiled."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ET.SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = ET.SubElement(build, "SourceFileSet", language="C99")
    ET.SubElement(files, "SourceFile", name=f"fmi3_{name}.c")
    return _text(root)


def _variables(exported: Exported, version: Version) -> Iterator[_Variable]:
    """Yield inputs, outputs and parameters in the order of the value references of both versions, then those of version 3."""
    for q in exported.inputs:
        yield _Variable(q.name, q.unit or _NO_UNIT, q.description, "input", start=0.0)
    for q in exported.outputs:
        yield _Variable(q.name, q.unit or _NO_UNIT, q.description, "output", initial="calculated")
    for q, value in exported.numbers:
        yield _Variable(q.name, q.unit or _NO_UNIT, q.description, "parameter", "fixed", "exact", value)
    if version == 2:
        return
    # What version 3 has no function for (slopes of inputs), and what it wants listed (the time).
    for q in exported.inputs if interpolates(exported) else ():
        unit = f"{q.unit}/s" if q.unit else "1/s"
        what = f"slope of {q.name} until the next communication point; 0 keeps it constant"
        yield _Variable(f"{q.name}_slope", unit, what, "input", start=0.0)
    yield _Variable("time", "s", "time", "independent")


def _unique(variables: Iterable[_Variable]) -> list[_Variable]:
    taken: set[str] = set()
    unique = []
    for variable in variables:
        # An output is most often the state of the same name, which an input or parameter may have too.
        name = variable.name if variable.name not in taken else f"{variable.causality}_{variable.name}"
        while name in taken:
            name += "_"
        taken.add(name)
        unique.append(replace(variable, name=name))
    return unique


def _add(listed: ET.Element, reference: int, variable: _Variable, version: Version) -> None:
    """List a variable: where 2.0 has an element for the number inside, 3.0 has all in one."""
    element = ET.SubElement(
        listed,
        "ScalarVariable" if version == 2 else "Float64",
        name=variable.name,
        valueReference=str(reference),
        description=variable.description,
        causality=variable.causality,
        variability=variable.variability,
    )
    if variable.initial is not None:
        element.set("initial", variable.initial)
    number = ET.SubElement(element, "Real") if version == 2 else element
    number.set("unit", variable.unit)
    if variable.start is not None:
        number.set("start", repr(variable.start))


def _text(root: ET.Element) -> str:
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _truth(value: bool) -> str:
    return "true" if value else "false"
