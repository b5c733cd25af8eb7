"""The page on the app lists the tasks that the browser does in the tests."""

from __future__ import annotations

import re
from pathlib import Path

from ..app.first_use import TASKS


def test_the_table_of_a_first_use_lists_the_tasks_of_the_test() -> None:
    page = (Path(__file__).parents[2] / "docs" / "app.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| (\d+) \| (.+?) \|", page, re.MULTILINE)
    assert listed == [(str(number), task.__doc__) for number, task in enumerate(TASKS, 1)]
