"""Names that share a description are told apart in the reference."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import pytest

GROUPED = """Do it.

Parameters
----------
first
    One.
low, high
    Ends,
    both [s].

    And more.
last
    Three.

Returns
-------
a, b
    Not a parameter.
"""


def test_each_name_gets_the_description(hook: Callable[[str], ModuleType]) -> None:
    pytest.importorskip("griffe", reason="griffe comes with `make docs`")
    text = hook("grouped_names").ungrouped(GROUPED)
    described = "    Ends,\n    both [s].\n\n    And more.\n"
    assert f"first\n    One.\nlow\n{described}high\n{described}last\n    Three.\n\n" in text
    assert text.endswith("Returns\n-------\na, b\n    Not a parameter.\n")
    assert hook("grouped_names").ungrouped(text) == text
