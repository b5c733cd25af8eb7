"""Every link of a page leads somewhere: in the repository as it is, and on the site."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [*(ROOT / "docs").glob("*.md"), *(ROOT / "experiments").glob("*/README.md"), *ROOT.glob("*.md")],
    key=str,
)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)


def links(page: Path) -> list[str]:
    """Return the targets of a page's links to files and headings of the repository."""
    text = re.sub(r"`[^`\n]*`", "", FENCE.sub("", page.read_text(encoding="utf-8")))
    return [
        target for target in LINK.findall(text) if "://" not in target and not target.startswith("mailto:")
    ]


def anchors(page: Path) -> set[str]:
    """Return the names by which a page's headings are linked to: lower case, words joined by hyphens."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_relative_link_leads_to_a_file_and_heading(page: Path) -> None:
    for target in links(page):
        path, _, anchor = target.partition("#")
        place = (page.parent / path).resolve() if path else page
        assert place.is_relative_to(ROOT), target
        assert place.exists(), f"{target}: no such file"
        if anchor:
            assert anchor in anchors(place), f"{target}: no such heading in {place.name}"


def test_links_are_found_at_all() -> None:
    found = {str(page.relative_to(ROOT)): links(page) for page in PAGES}
    assert "docs/thesis.md" in found["README.md"]
    assert "verdict.md#when-not-to-trust-it" in found["docs/index.md"]


def test_links_on_the_site_lead_to_its_pages(hook: Callable[[str], ModuleType]) -> None:
    turned = hook("repository_links").with_site_links
    known = {
        "verdict.md",
        "effects/index.md",
        "effects/backlash.md",
        "experiments/thesis.md",
        "reference/records.md",
        "thesis.md",
    }
    for text, page, expected in (
        ("[a](../src/rigsight/effects/backlash.py)", "verdict.md", "[a](effects/backlash.md)"),
        ("[a](../src/rigsight/effects)", "verdict.md", "[a](effects/index.md)"),
        ("[a](../src/rigsight/records)", "verdict.md", "[a](reference/records.md)"),
        ("[a](../experiments/thesis/README.md#b)", "verdict.md", "[a](experiments/thesis.md#b)"),
        ("[a](../../docs/thesis.md)", "experiments/thesis.md", "[a](../thesis.md)"),
        ("[a](../../src/rigsight/effects)", "experiments/thesis.md", "[a](../effects/index.md)"),
        ("[a](../LICENSE)", "verdict.md", "a (`LICENSE`)"),
        ("[a](not_there.md)", "verdict.md", "[a](not_there.md)"),
        ("[a](https://example.org/b)", "verdict.md", "[a](https://example.org/b)"),
        ("[a](#b)", "verdict.md", "[a](#b)"),
        ("```\n[a](../LICENSE)\n```", "verdict.md", "```\n[a](../LICENSE)\n```"),
    ):
        assert turned(text, page, known) == expected
