"""What does the ``modelDescription.xml`` of an FMU say?"""

from __future__ import annotations

from xml.etree import ElementTree as ET

from rigsight.export.description import equation_lines, hold_text, made_by
from rigsight.export.equations import Exported, Quantity

_NO_UNIT = "1"


def interpolates(exported: Exported) -> bool:
    """Return True if derivatives of the inputs are of use within a communication step."""
    return exported.rest is None or exported.hold == "foh"


def needs_constant_step(exported: Exported) -> bool:
    """Return True if the model remembers samples, which must lie equally far apart."""
    return exported.structure.delay is not None or exported.structure.measured_late is not None


def model_description(exported: Exported, source: str, name: str, guid: str) -> str:
    """Return the text of the description.

    Parameters
    ----------
    exported
        The model.
    source
        The file it comes from.
    name
        Identifier of the model.
    guid
        What ties description and binary together.
    """
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=name,
        guid=guid,
        description=f"{exported.title}. A communication step is a sample: {hold_text(exported)}. "
        + "; ".join(equation_lines(exported)),
        generationTool=made_by(source).removeprefix("Made by "),
        variableNamingConvention="flat",
        numberOfEventIndicators="0",
    )
    simulation = ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=name,
        canHandleVariableCommunicationStepSize=_truth(not needs_constant_step(exported)),
        canInterpolateInputs=_truth(interpolates(exported)),
        maxOutputDerivativeOrder="0",
        canGetAndSetFMUstate="true",
        canNotUseMemoryManagementFunctions="true",
    )
    files = ET.SubElement(simulation, "SourceFiles")
    ET.SubElement(files, "File", name=f"fmi2_{name}.c")
    quantities = (*exported.inputs, *exported.outputs, *exported.parameters)
    units = ET.SubElement(root, "UnitDefinitions")
    for unit in sorted({q.unit for q in quantities}):
        ET.SubElement(units, "Unit", name=unit or _NO_UNIT)
    variables = ET.SubElement(root, "ModelVariables")
    reference = 0
    taken: set[str] = set()
    groups: list[tuple[str, str, tuple[Quantity, ...], tuple[float, ...] | None]] = [
        ("input", "continuous", exported.inputs, tuple(0.0 for _ in exported.inputs)),
        ("output", "continuous", exported.outputs, None),
        ("parameter", "fixed", exported.parameters, exported.values),
    ]
    outputs = []
    for causality, variability, members, starts in groups:
        for i, quantity in enumerate(members):
            own = quantity.name if quantity.name not in taken else f"{causality}_{quantity.name}"
            taken.add(own)
            variable = ET.SubElement(
                variables,
                "ScalarVariable",
                name=own,
                valueReference=str(reference),
                description=quantity.description,
                causality=causality,
                variability=variability,
            )
            if causality == "output":
                variable.set("initial", "calculated")
                outputs.append(reference + 1)
            elif causality == "parameter":
                variable.set("initial", "exact")
            real = ET.SubElement(variable, "Real", unit=quantity.unit or _NO_UNIT)
            if starts is not None:
                real.set("start", repr(starts[i]))
            reference += 1
    structure = ET.SubElement(root, "ModelStructure")
    for group in ("Outputs", "InitialUnknowns"):
        unknowns = ET.SubElement(structure, group)
        for index in outputs:
            ET.SubElement(unknowns, "Unknown", index=str(index))
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _truth(value: bool) -> str:
    return "true" if value else "false"
