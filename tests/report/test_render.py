from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from html.parser import HTMLParser
from itertools import pairwise

import pytest

from rigsight.diagnose.result import Diagnosis

from ..tiers import slow_but

VOID = {"meta", "br", "img", "input", "link", "hr", "col"}
VARIANTS = (
    "effect", "two effects", "own effect", "parameters", "none", "unknown", "no candidates", "not finite", "no validation",
    "element", "hostile", "advised", "nothing given", "nothing given, no gap", "loops",
)  # fmt: skip


class Page(HTMLParser):
    """What the tests ask of a page: its tags balanced, its ids, its references, its text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] not in ("style", "script"):
            self.text.append(data)

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attrs for name, attrs in self.tags if name == tag]

    def words(self) -> str:
        return " ".join(" ".join(self.text).split())


@pytest.fixture(
    params=slow_but("effect", "two effects", "unknown", "none", "not finite", "hostile", of=VARIANTS)
)
def html(request: pytest.FixtureRequest, page_of: Callable[[str], str]) -> str:
    return page_of(request.param)


def test_every_kind_of_result_is_one_sound_page(html: str) -> None:
    page = Page(html)
    ids = Counter(attrs["id"] for _, attrs in page.tags if "id" in attrs)
    assert [name for name, count in ids.items() if count > 1] == []
    targets = [attrs["href"] for _, attrs in page.tags if attrs.get("href")]
    drawn = re.sub(r"<script>.*?</script>", "", html, flags=re.DOTALL)
    targets += [f"#{name}" for name in re.findall(r"url\(#([^)]+)\)", drawn)]
    assert [target for target in targets if target[:1] != "#" or target[1:] not in ids] == []
    labels = [attrs["aria-labelledby"] for _, attrs in page.tags if attrs.get("aria-labelledby")]
    assert set(labels) <= set(ids)


def test_the_page_asks_nothing_of_the_network(html: str) -> None:
    page = Page(html)
    assert page.all("link") == page.all("iframe") == []
    assert all("src" not in attrs for attrs in page.all("script"))
    sources = [attrs[key] or "" for _, attrs in page.tags for key in ("src", "href") if key in attrs]
    assert all(source.startswith(("#", "data:image/png")) for source in sources)
    # The one address is where uPlot comes from, in its first comment.
    assert set(re.findall(r"(?:https?:)?//\w[^\" ]*", re.sub(r"base64,[^\"]*", "", html))) == {
        "https://github.com/leeoniya/uPlot"
    }
    assert "@import" not in html


def test_the_page_can_be_read_without_seeing_it(html: str) -> None:
    page = Page(html)
    assert page.all("html")[0]["lang"] == "en"
    for landmark in ("header", "nav", "main", "footer", "h1"):
        assert len(page.all(landmark)) == 1, landmark
    assert all(attrs.get("scope") for attrs in page.all("th"))
    assert len(page.all("caption")) == len(page.all("table"))
    figures, pictures = page.all("figure"), [*page.all("svg"), *page.all("img")]
    # What the script draws has its numbers as text while the cursor is there; a <noscript> stands in for it.
    assert len(page.all("figcaption")) == len(figures) <= len(pictures) + len(page.all("noscript"))
    assert all(attrs.get("aria-label") or attrs.get("alt") for attrs in pictures)
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch("h[1-6]", tag)]
    assert all(after <= before + 1 for before, after in pairwise(levels))


def test_names_from_files_are_text_and_never_markup(page_of: Callable[[str], str]) -> None:
    html = page_of("hostile")
    page = Page(html)
    kinds = [attrs.get("type") for attrs in page.all("script")]
    assert kinds.count(None) == 1, "only the page's own script may run"
    assert set(kinds) <= {None, "application/json"}
    assert '<script>alert("1")</script> & $x_1$' in page.words()
    assert "<x<y>" not in html
    assert page.all("y") == page.all("b<") == []


def test_the_page_says_verdict_and_evidence(page_of: Callable[[str], str], diagnosis: Diagnosis) -> None:
    words = Page(page_of("effect")).words()
    assert "Most likely the gap is caused by Bouc-Wen hysteresis in the yaw dynamics" in words
    assert "cannot tell Bouc-Wen hysteresis from Coulomb friction and cubic stiffness" in words
    assert "yaw angle psi" in words
    assert "0.4 mrad" in words
    assert "30 µm" in words
    assert "stretches in which the input rests" in words
    assert "lateral displacement y was not recorded" in words
    assert "not determined by these records (stands at 497)" in words
    assert "(−3.100 ± 0.020) · 10 5" in words
    assert "rigsight diagnose data <&>" in words
    assert "rigsight 0.1.0, numpy 2.4" in words
    assert "Seed 7" in words
    for note in diagnosis.notes:
        assert note in words


def test_records_that_were_scored_come_first_and_open(page_of: Callable[[str], str]) -> None:
    records = Page(page_of("effect")).all("details")
    assert ["open" in attrs for attrs in records] == [True, True, False]


def test_parameters_without_a_fit_come_from_the_model(page_of: Callable[[str], str]) -> None:
    words = Page(page_of("none")).words()
    assert "J_z 0.5612 kg m 2 yaw inertia of the axle bridge" in words


@pytest.mark.slow
def test_long_records_make_no_heavy_page(page_of: Callable[[str], str]) -> None:
    assert len(page_of("long").encode()) < 3_000_000


def test_the_page_says_what_to_measure_next_and_what_the_records_show(
    page_of: Callable[[str], str],
) -> None:
    words = Page(page_of("advised")).words()
    assert (
        "To confirm or rule out Coulomb friction, record a sweep of amplitude 1.25 A from 0.5 to 40 rad/s"
        in words
    )
    assert (
        "None of the experiments considered would rule out Stribeck friction: with the best, a sine of amplitude 0.5 A at 3 rad/s"
        in words
    )
    assert (
        "all.csv, psi clipping, a fault Channel psi stands still at its ends. Widen its range. 40 %" in words
    )
    assert "all records quantization Steps of psi are coarse. Use a finer sensor. not measured" in words
    assert "u \u2192 psi changes with the amplitude" in words


def test_parameters_have_intervals_inside_their_own_range(page_of: Callable[[str], str]) -> None:
    words = Page(page_of("effect")).words()
    assert "J_z 0.5612 \u00b1 0.0021 0.5571 to 0.5653 kg m 2" in words
    assert (
        "k_3 (\u22123.100 \u00b1 0.020) \u00b7 10 5 \u22123.139 \u00b7 10 5 to \u22123.061 \u00b7 10 5"
        in words
    )


@pytest.mark.parametrize("name", ["nothing given", "nothing given, no gap"])
def test_where_nothing_was_given_the_page_speaks_of_no_given_simulation(
    page_of: Callable[[str], str], name: str
) -> None:
    html = page_of(name)
    # Names of curves and labels for screen readers count, the colors and names inside style and script do not.
    said = re.sub(r"<style>.*?</style>|<script>.*?</script>", "", html, flags=re.DOTALL)
    assert "identified" in said
    assert re.findall(r".{0,40}(?:given sim|as given|re-identified|better numbers).{0,20}", said, re.I) == []
    assert re.findall(r'"of":"before"', html) == []
    assert "given simulation" in page_of("effect")


def test_an_element_shows_its_force_over_its_motion(page_of: Callable[[str], str]) -> None:
    html = page_of("loops")
    assert 'href="#loops"' in html
    assert "Force over x and over its rate, record bench small" in Page(html).words()
    assert 'id="loops"' not in page_of("effect")


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("effect", "<dt>Probability</dt>"), ("none", "<dt>Probability of no missing effect</dt>"),
        ("unknown", "<dt>Probability of a cause that is none of the families</dt>"),
    ],
)  # fmt: skip
def test_the_probability_is_labelled_by_what_the_verdict_states(
    page_of: Callable[[str], str], name: str, label: str
) -> None:
    assert label in page_of(name)


def test_an_unknown_gap_is_described_by_the_force_that_is_lacking(page_of: Callable[[str], str]) -> None:
    assert "a force of 0.3 N m RMS is missing in the yaw dynamics" in page_of("unknown")
    assert "RMS is missing" not in page_of("effect")
