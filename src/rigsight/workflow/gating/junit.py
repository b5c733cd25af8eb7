"""The checks of a gate as JUnit XML, which pipelines show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as ET


@dataclass(frozen=True)
class Case:
    """One check."""

    name: str
    text: str  # what was found
    failed: bool


def junit_xml(suite: str, cases: Sequence[Case], text: str) -> str:
    """Return a test suite as XML; the text says what was found as a whole."""
    failures = str(sum(case.failed for case in cases))
    counts = {"name": suite, "tests": str(len(cases)), "failures": failures, "errors": "0", "skipped": "0"}
    root = ET.Element("testsuites", {key: counts[key] for key in ("tests", "failures")})
    element = ET.SubElement(root, "testsuite", counts)
    for case in cases:
        own = ET.SubElement(element, "testcase", classname=suite, name=_printed(case.name), time="0")
        if case.failed:
            ET.SubElement(own, "failure", message=_printed(case.text), type="gap")
        else:
            ET.SubElement(own, "system-out").text = _printed(case.text)
    ET.SubElement(element, "system-out").text = _printed(text)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _printed(text: str) -> str:
    """Return a text with a sign for each character that XML does not allow."""
    return "".join(sign if sign.isprintable() else "\ufffd" for sign in text)
