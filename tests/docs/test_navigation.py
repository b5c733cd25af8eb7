"""Every page stands in the navigation of the site, and every entry there is a page."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[2]
GENERATED = {"effects/index.md", "reference/index.md", "verdict_numbers.md"}
PUT_IN_WHERE_IT_EXISTS = {"blind.md"}


def test_the_navigation_names_every_page_once(hook: Callable[[str], ModuleType]) -> None:
    nav = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2].partition("\n\n")[0]
    entries = re.findall(r": (\S+\.md)$", nav, re.MULTILINE)
    written = {str(page.relative_to(ROOT / "docs")) for page in (ROOT / "docs").rglob("*.md")}
    moved = hook("repository_links").MOVED
    assert all((ROOT / path).is_file() for path in moved)
    studies = {str(page.relative_to(ROOT)) for page in (ROOT / "experiments").glob("*/README.md")}
    assert studies <= set(moved), "a study's README becomes a page by docs/hooks/repository_links.py"
    expected = (written - PUT_IN_WHERE_IT_EXISTS) | set(moved.values()) | GENERATED
    assert sorted(entries) == sorted(expected), "mkdocs.yml says under nav which pages there are"
