"""Content of the ``modelDescription.xml`` of an FMU, for FMI 2.0 and 3.0."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal
from xml.etree import ElementTree as ET

from rigsight.export.description import equation_lines, hold_text, made_by
from rigsight.export.equations import Exported

_NO_UNIT = "1"


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


def needs_constant_step(exported: Exported) -> bool:
    """Return True if the model remembers samples, which must lie equally far apart."""
    return exported.structure.delay is not None or exported.structure.first_shown_late is not None


def model_description(
    exported: Exported, source: str, name: str, guid: str, version: Literal[2, 3] = 2
) -> str:
    """Return the text of the description."""
    variables = _unique([*_common(exported), *(_of_version_3(exported) if version == 3 else ())])
    root = ET.Element("fmiModelDescription", fmiVersion=f"{version}.0", modelName=name)
    root.set("guid" if version == 2 else "instantiationToken", guid)
    root.set(
        "description",
        f"{exported.title}. A communication step is a sample: {hold_text(exported)}. "
        + "; ".join(equation_lines(exported)),
    )
    root.set("generationTool", made_by(source).removeprefix("Made by "))
    root.set("variableNamingConvention", "flat")
    if version == 2:
        root.set("numberOfEventIndicators", "0")
    simulation = ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=name,
        canHandleVariableCommunicationStepSize=_truth(not needs_constant_step(exported)),
    )
    if version == 2:
        simulation.set("canInterpolateInputs", _truth(interpolates(exported)))
        simulation.set("canGetAndSetFMUstate", "true")
        simulation.set("canNotUseMemoryManagementFunctions", "true")
        files = ET.SubElement(simulation, "SourceFiles")
        ET.SubElement(files, "File", name=f"fmi2_{name}.c")
    else:
        simulation.set("canGetAndSetFMUState", "true")
    units = ET.SubElement(root, "UnitDefinitions")
    for unit in sorted({variable.unit for variable in variables}):
        ET.SubElement(units, "Unit", name=unit)
    listed = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        _add(listed, reference, variable, version)
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [i for i, variable in enumerate(variables) if variable.causality == "output"]
    for index in outputs if version == 3 else ():
        ET.SubElement(structure, "Output", valueReference=str(index))
    for index in outputs if version == 3 else ():
        ET.SubElement(structure, "InitialUnknown", valueReference=str(index))
    for group in ("Outputs", "InitialUnknowns") if version == 2 else ():
        unknowns = ET.SubElement(structure, group)
        for index in outputs:
            ET.SubElement(unknowns, "Unknown", index=str(index + 1))
    return _text(root)


def build_description(name: str) -> str:
    """Return how the sources of an FMI 3.0 FMU are compiled."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ET.SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = ET.SubElement(build, "SourceFileSet", language="C99")
    ET.SubElement(files, "SourceFile", name=f"fmi3_{name}.c")
    return _text(root)


def _common(exported: Exported) -> Iterator[_Variable]:
    """Yield inputs, outputs and parameters in the order of the value references of both versions."""
    for q in exported.inputs:
        yield _Variable(q.name, q.unit or _NO_UNIT, q.description, "input", start=0.0)
    for q in exported.outputs:
        yield _Variable(q.name, q.unit or _NO_UNIT, q.description, "output", initial="calculated")
    for q, value in zip(exported.parameters, exported.values, strict=True):
        yield _Variable(q.name, q.unit or _NO_UNIT, q.description, "parameter", "fixed", "exact", value)


def _of_version_3(exported: Exported) -> Iterator[_Variable]:
    """Yield what that version has no function for (slopes of inputs), and what it wants listed (the time)."""
    for q in exported.inputs if interpolates(exported) else ():
        unit = f"{q.unit}/s" if q.unit else "1/s"
        what = f"slope of {q.name} until the next communication point; 0 keeps it constant"
        yield _Variable(f"{q.name}_slope", unit, what, "input", start=0.0)
    yield _Variable("time", "s", "time", "independent")


def _unique(variables: list[_Variable]) -> list[_Variable]:
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


def _add(listed: ET.Element, reference: int, variable: _Variable, version: Literal[2, 3]) -> None:
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
