"""The page of a score stands alone, says first whether goals are reached, and fits a phone."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest

from rigsight_bench.report.page import render_blind
from rigsight_bench.scoring import Outcome

from ...chromium import BROWSERS, Chromium, find
from .blind_content import content_of

Like = Callable[..., Outcome]
VOID = {"meta", "br", "img", "link", "hr", "input"}


class Nested(HTMLParser):
    """Collects ids and links, and fails where elements do not nest."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        self.ids += [value for name, value in attrs if name == "id" and value]
        self.links += [value for name, value in attrs if name == "href" and value]

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.ids += [value for name, value in attrs if name == "id" and value]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture
def page(outcome_like: Like, wrong_outcome: Like) -> str:
    right = [outcome_like(trial=f"{n:03d}", stated=0.97) for n in range(8)]
    return render_blind(content_of([*right, wrong_outcome(trial="017", message="<b>told</b>")]))


def test_a_page_nests_and_its_links_lead_somewhere(page: str) -> None:
    parser = Nested()
    parser.feed(page)
    assert parser.open == []
    assert len(parser.ids) == len(set(parser.ids))
    inside = [link[1:] for link in parser.links if link.startswith("#")]
    assert set(inside) <= set(parser.ids)
    assert [link for link in parser.links if not link.startswith("#")] == ["results/017/report.html"]


def test_a_laboratory_has_a_table_by_condition(outcome_like: Like, page: str) -> None:
    taken = render_blind(content_of([outcome_like(condition="antialias_filter")]))
    assert "Table by condition" in taken
    assert "Antialias filter" in taken
    assert "Table by condition" not in page


def test_a_page_needs_nothing_beside_it(page: str) -> None:
    assert "<script" not in page
    assert re.findall(r'\b(?:src|href)="(?:https?:)?//', page) == []
    assert "default-src 'none'" in page


def test_the_verdict_comes_first_and_a_wrong_trial_with_its_command(page: str) -> None:
    assert page.index("Goals not all reached") < page.index('id="goals"')
    assert "<code>rigsight blind --trial 017</code>" in page
    assert "&lt;b&gt;told&lt;/b&gt;" in page


def test_a_page_of_nothing_and_one_without_a_mistake_can_be_drawn(outcome_like: Like) -> None:
    assert "No trial counts towards a goal" in render_blind(content_of([]))
    assert "Goals reached" in render_blind(content_of([outcome_like(probability=0.99)]))


def test_a_long_list_of_wrong_trials_is_cut_and_says_so(wrong_outcome: Like) -> None:
    page = render_blind(content_of([wrong_outcome(trial=f"{n:03d}") for n in range(501)]))
    assert "The first 500 of 501" in page
    assert page.count("rigsight blind --trial") == 500


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    path = find()
    if path is None:
        pytest.skip(f"no browser here ({', '.join(BROWSERS)}); the page was checked as text only")
    chromium = Chromium(path, tmp_path_factory.mktemp("browser"))
    yield chromium
    chromium.close()


@pytest.mark.release
@pytest.mark.parametrize("width", [1280, 400])
def test_a_page_opens_without_complaint_and_fits(
    browser: Chromium, page: str, tmp_path: Path, width: int
) -> None:
    file = tmp_path / "blind.html"
    file.write_text(page, encoding="utf-8")
    browser.open(file, width, touch=width < 500)
    assert browser.evaluate("document.documentElement.scrollWidth") == width
    bad = ("Log.entryAdded", "Runtime.exceptionThrown")
    assert [event for event in browser.events if event.get("method") in bad] == []
