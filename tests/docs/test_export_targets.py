"""Every target of an export is in the documentation."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rigsight.export import TARGETS
from rigsight.workflow.export import ROBOT_TARGETS

DOCS = Path(__file__).parents[2] / "docs"
ALL = (*TARGETS, *ROBOT_TARGETS)


@pytest.mark.parametrize("target", ALL)
def test_it_has_a_row_on_the_page_of_exports(target: str) -> None:
    text = (DOCS / "exports.md").read_text("utf-8")
    rows = re.findall(r"^\|([^|]*)\|", text, re.MULTILINE)
    assert any(f"`{target}`" in row for row in rows), (
        f"Add a row for {target} to the table in docs/exports.md."
    )
