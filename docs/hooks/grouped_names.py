"""How does the reference show names that share one description, each with its own type?

Docstrings say ``omega_start, omega_stop`` once for both. Read as it stands, the reference would give all of them the type and
default of the first; here every name gets a copy of the description before it is read. mkdocs.yml names this file as an
extension.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

_SECTION = re.compile(
    r"^(Parameters|Attributes)\n-+\n(?P<entries>.*?)(?=^\S[^\n]*\n-{3,}$|\Z)", re.MULTILINE | re.DOTALL
)
_GROUP = re.compile(r"^(?P<names>\w+(?:, \w+)+)\n(?P<text>(?:(?:[ \t]+[^\n]*)?(?:\n|\Z))*)", re.MULTILINE)


def ungrouped(docstring: str) -> str:
    """Return a numpydoc docstring in which each parameter and attribute stands by itself."""

    def each(group: re.Match[str]) -> str:
        return "".join(f"{name}\n{group['text']}" for name in group["names"].split(", "))

    def section(found: re.Match[str]) -> str:
        return found[0].replace(found["entries"], _GROUP.sub(each, found["entries"].rstrip() + "\n\n"))

    return _SECTION.sub(section, docstring)


class GroupedNames(griffe.Extension):
    """Ungroups the docstring of every object."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Change one docstring."""
        if obj.docstring is not None:
            obj.docstring.value = ungrouped(obj.docstring.value)
