"""What does the reference of a public package say? mkdocstrings fills it from the docstrings."""

from __future__ import annotations

import ast
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src/rigsight"
PACKAGES = (
    "records",
    "parameters",
    "units",
    "errors",
    "excitation",
    "metrics",
    "effects",
    "rigs",
    "simulate",
    "frequency",
    "identify",
    "discover",
    "compare",
    "diagnose",
    "blind",
    "workflow",
    "plot",
    "report",
)
"""From what is measured to what is shown, as the rooms of the house lie above each other."""
COMMANDS = (
    "campaign",
    "diagnose",
    "identify",
    "discover",
    "compare",
    "simulate",
    "vary",
    "blind",
    "model_file",
)
"""Modules of `rigsight.workflow` that are public one by one: each command is a function of its own module."""


def question(name: str) -> str:
    """Return the first line of a package's docstring."""
    folder = SOURCE / name
    file = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
    return (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").partition("\n")[0]


def reference_index() -> str:
    """Return the page that lists the packages."""
    rows = [f"| [`rigsight.{name}`]({name}.md) | {question(name)} |" for name in PACKAGES]
    return "\n".join(
        [
            "# Python reference",
            "",
            "SI units everywhere; axis 0 of an array is time or frequency; angular frequency `omega` is in rad/s, sample time "
            "`dt` in s. Public names are those shown here; anything else may change without notice.",
            "",
            "| package | what it answers |",
            "|---|---|",
            *rows,
            "",
        ]
    )


def reference_page(name: str) -> str:
    """Return the page of a package."""
    identifiers = [f"rigsight.{name}"]
    if name == "workflow":
        identifiers += [f"rigsight.workflow.{command}" for command in COMMANDS]
    blocks = "\n".join(f"::: {identifier}\n" for identifier in identifiers)
    return f"# rigsight.{name}\n\n{blocks}"
