"""Is what a notebook shows of a result whole, and is everything that comes from data escaped?"""

from __future__ import annotations

from collections.abc import Callable
from html.parser import HTMLParser

import pytest

from rigsight.diagnose.result import Diagnosis
from rigsight.report.terminal import diagnosis_html

KINDS = (
    "effect", "two effects", "own effect", "parameters", "none", "no candidates", "unknown", "not finite",
    "no validation", "element", "hostile", "nothing given", "advised",
)  # fmt: skip
EMPTY = {"br", "hr", "img", "meta"}


class Tags(HTMLParser):
    """Collects tags and texts, and checks that every tag is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.add(tag)
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_diagnosis_can_be_shown(kind: str, variant: Callable[[str], Diagnosis]) -> None:
    shown = Tags()
    shown.feed(diagnosis_html(variant(kind)))
    shown.close()
    assert shown.open == []
    # Nothing that runs, nothing that is fetched.
    assert shown.seen <= {
        "div",
        "p",
        "strong",
        "table",
        "thead",
        "tbody",
        "tr",
        "th",
        "td",
        "details",
        "summary",
        "ul",
        "li",
    }
    assert variant(kind).title in shown.text


def test_it_says_verdict_gap_and_numbers(variant: Callable[[str], Diagnosis]) -> None:
    diagnosis = variant("effect")
    text = diagnosis_html(diagnosis)
    assert "Missing effect" in text
    for output in diagnosis.gap:
        assert f"gap in {output}" in text
    assert "noise floor" in text


def test_data_cannot_become_markup(variant: Callable[[str], Diagnosis]) -> None:
    text = diagnosis_html(variant("hostile"))
    assert "<script" not in text
    assert "&lt;script&gt;" in text
    assert "x&lt;y&gt;" in text
