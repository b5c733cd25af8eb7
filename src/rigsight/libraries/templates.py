"""Templates of generated code: text files of a package in which marks ``<<KEY>>`` are replaced."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import files


@cache
def template(package: str, name: str) -> str:
    """Return the text of a file in the folder ``templates`` of a package of rigsight."""
    return files(f"rigsight.{package}").joinpath("templates", name).read_text("utf-8")


@cache
def template_parts(package: str, name: str) -> Mapping[str, str]:
    """Return the parts of such a file; a line ``@@ KEY`` stands above each, and the line end before it belongs to none."""
    text = "\n" + template(package, name).removesuffix("\n")
    return dict(part.split("\n", 1) for part in text.split("\n@@ ")[1:])


def filled(text: str, fragments: Mapping[str, object]) -> str:
    """Return a template with every mark replaced, in the order given: a fragment may hold marks of later ones."""
    for key, fragment in fragments.items():
        text = text.replace(f"<<{key}>>", str(fragment))
    return text
