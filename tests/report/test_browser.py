"""The page in a real browser: it opens without a complaint, its plots react, it fits a phone, it prints whole."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from rigsight.diagnose.result import Diagnosis
from rigsight.report import render_report

from .chromium import BROWSERS, Chromium, find

pytestmark = pytest.mark.release
FIRST = "document.querySelector('#record-1-output-1')"
RESPONSE = "document.querySelector('#record-1-path-1')"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    path = find()
    if path is None:
        pytest.skip(f"no browser here ({', '.join(BROWSERS)}); the page was checked as text only")
    chromium = Chromium(path, tmp_path_factory.mktemp("browser"))
    yield chromium
    chromium.close()


@pytest.fixture(scope="module")
def page(variant: Callable[[str], Diagnosis], tmp_path_factory: pytest.TempPathFactory) -> Path:
    advised, whole = variant("advised"), variant("effect")
    text = render_report(replace(advised, traces=whole.traces), "rigsight diagnose x", {"rigsight": "0.1"}, 0)
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def opened(browser: Chromium, page: Path) -> Chromium:
    browser.open(page)
    browser.settle()
    return browser


def ticks(chromium: Chromium, figure: str = FIRST) -> list[float]:
    """Return the labels of the time or frequency axis."""
    texts = chromium.evaluate(
        f"[...{figure}.querySelectorAll('svg[role=application] text[text-anchor=middle]:not(.name)')].map((t) => t.textContent)"
    )
    return [float(text.replace("\u2212", "-")) for text in texts]


def place(chromium: Chromium, share: float, figure: str = FIRST) -> tuple[float, float]:
    """Return a point of the plot, at a share of its width, in the window."""
    chromium.evaluate(
        f"{figure}.querySelector('svg[role=application]').scrollIntoView({{block: 'center', behavior: 'instant'}})"
    )
    chromium.settle()
    left, top, width, height = chromium.evaluate(
        f"(() => {{ const r = {figure}.querySelector('svg[role=application]').getBoundingClientRect();"
        "return [r.left, r.top, r.width, r.height]; })()"
    )
    return left + 58 + share * (width - 70), top + 0.3 * height


def reading(chromium: Chromium, figure: str = FIRST) -> str:
    return str(chromium.evaluate(f"{figure}.querySelector('.reading').textContent"))


def drag(chromium: Chromium, start: float, end: float, figure: str = FIRST) -> None:
    (x, y), (to, _) = place(chromium, start, figure), place(chromium, end, figure)
    chromium.mouse("mouseMoved", x, y, button="none")
    chromium.mouse("mousePressed", x, y)
    chromium.mouse("mouseMoved", 0.5 * (x + to), y)
    chromium.mouse("mouseMoved", to, y)
    chromium.mouse("mouseReleased", to, y)


def test_it_opens_without_a_complaint_and_loads_nothing_else(opened: Chromium, page: Path) -> None:
    assert opened.complaints() == []
    assert opened.requests() == [page.as_uri()]
    # Five outputs over time and four signal paths over frequency: the step drives seven lines, too few to be drawn.
    assert opened.evaluate("document.querySelectorAll('figure.reacting').length") == 9
    assert opened.evaluate("document.querySelectorAll('figure.live').length") == 9


def test_a_complaint_would_be_seen(browser: Chromium, tmp_path: Path) -> None:
    (tmp_path / "bad.html").write_text("<script>undefinedName()</script>", encoding="utf-8")
    browser.open(tmp_path / "bad.html")
    assert len(browser.complaints()) == 1


def test_the_policy_of_the_page_refuses_any_other_script(
    browser: Chromium, page: Path, tmp_path: Path
) -> None:
    text = page.read_text(encoding="utf-8").replace(
        "</main>", "<script>document.title = 'other'</script></main>"
    )
    (tmp_path / "other.html").write_text(text, encoding="utf-8")
    browser.open(tmp_path / "other.html")
    assert browser.evaluate("document.title") != "other"
    assert any("Content Security Policy" in complaint for complaint in browser.complaints())


def test_dragging_zooms_and_a_double_click_shows_all_again(opened: Chromium) -> None:
    whole = ticks(opened)
    drag(opened, 0.4, 0.6)
    zoomed = ticks(opened)
    # Ten seconds in all: what was dragged over is 4 s to 6 s.
    assert 4.0 <= zoomed[0] < zoomed[-1] <= 6.0
    assert opened.evaluate(f"{FIRST}.querySelector('path.line.measured').getAttribute('d').length") > 500
    x, y = place(opened, 0.5)
    for count in (1, 2):
        opened.mouse("mousePressed", x, y, clickCount=count)
        opened.mouse("mouseReleased", x, y, clickCount=count)
    assert ticks(opened) == whole


def test_a_logarithmic_axis_zooms_by_ratios(opened: Chromium) -> None:
    low, high = opened.evaluate(f"JSON.parse({RESPONSE}.querySelector('script').textContent).range")
    assert ticks(opened, RESPONSE)[-1] > 1.1 * (low * high) ** 0.5
    drag(opened, 0.0, 0.5, RESPONSE)
    zoomed = ticks(opened, RESPONSE)
    # Half of the axis from its left is the square root of the ratio; a drag ends within a pixel.
    assert 0.5 * (low * high) ** 0.5 < zoomed[-1] <= 1.02 * (low * high) ** 0.5


def test_keys_zoom_move_read_and_reset(opened: Chromium) -> None:
    opened.evaluate(f"{FIRST}.querySelector('svg[role=application]').focus()")
    whole = ticks(opened)
    opened.key("+", "+")
    inside = ticks(opened)
    assert inside[-1] - inside[0] < 0.7 * (whole[-1] - whole[0])
    opened.key("ArrowRight", modifiers=8)
    assert ticks(opened)[-1] > inside[-1]
    opened.key("ArrowRight")
    assert reading(opened).startswith("t = ")
    assert "measured" in reading(opened)
    first = reading(opened)
    opened.key("ArrowRight")
    assert reading(opened) != first
    opened.key("Escape")
    assert reading(opened).startswith("Drag to zoom")
    for _ in range(3):
        opened.key("+", "+")
    narrow = ticks(opened)
    opened.key("-", "-")
    assert ticks(opened)[-1] - ticks(opened)[0] > 1.4 * (narrow[-1] - narrow[0])
    opened.key("0", "0")
    assert ticks(opened) == whole


def test_the_pointer_reads_the_value_of_the_record(opened: Chromium, diagnosis: Diagnosis) -> None:
    x, y = place(opened, 0.25)
    opened.mouse("mouseMoved", x, y, button="none")
    found = re.match(
        r"t = ([\d.]+) s; psi \[mrad\]: measured (\u2212?[\d.]+), given simulation", reading(opened)
    )
    assert found, reading(opened)
    trace = next(trace for trace in diagnosis.traces if trace.record == "sweep_A0.75.csv")
    index = round(float(found[1]) / 0.005)
    near = 1e3 * trace.measured["psi"][index - 3 : index + 4]
    value = float(found[2].replace("\u2212", "-"))
    # The time is written to a thousandth of the picture, two samples.
    assert near.min() - 0.2 <= value <= near.max() + 0.2


def test_a_curve_can_be_taken_away_and_the_axis_follows(opened: Chromium) -> None:
    button = f"{FIRST}.querySelector('button.before')"
    assert opened.evaluate(f"{button}.getAttribute('aria-pressed')") == "true"
    before = opened.evaluate(f"{FIRST}.querySelectorAll('path.line').length")
    opened.evaluate(f"{button}.click()")
    assert opened.evaluate(f"{button}.getAttribute('aria-pressed')") == "false"
    assert opened.evaluate(f"{FIRST}.querySelectorAll('path.line').length") == before - 2


def test_buttons_zoom_without_a_mouse_or_keys(opened: Chromium) -> None:
    whole = ticks(opened)
    press = f"[...{FIRST}.querySelectorAll('button')].find((b) => b.textContent === '%s').click()"
    opened.evaluate(press % "Largest error")
    detail = ticks(opened)
    assert detail[-1] - detail[0] < 0.5 * (whole[-1] - whole[0])
    opened.evaluate(press % "All")
    assert ticks(opened) == whole


def test_a_phone_shows_it_without_scrolling_sideways_and_a_finger_zooms(
    browser: Chromium, page: Path
) -> None:
    browser.open(page, 400, 800, touch=True)
    browser.settle()
    assert browser.complaints() == []
    assert browser.evaluate("document.documentElement.scrollWidth") <= 400
    small = browser.evaluate(
        "[...document.querySelectorAll('button')].filter("
        "(b) => b.offsetParent && Math.min(b.offsetWidth, b.offsetHeight) < 24).length"
    )
    assert small == 0
    whole = ticks(browser)
    x, y = place(browser, 0.2)
    to, _ = place(browser, 0.5)
    browser.send("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
    for share in (0.25, 0.5, 0.75, 1.0):
        browser.send(
            "Input.dispatchTouchEvent", type="touchMove", touchPoints=[{"x": x + share * (to - x), "y": y}]
        )
    browser.send("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    browser.settle()
    zoomed = ticks(browser)
    assert 2.0 <= zoomed[0] < zoomed[-1] <= 5.0
    assert zoomed != whole


def test_every_anchor_leads_to_something_that_is_shown(opened: Chromium) -> None:
    links = opened.evaluate("[...document.querySelectorAll('a[href]')].map((a) => a.getAttribute('href'))")
    assert len(links) >= 10
    for link in links:
        opened.evaluate(f"document.querySelector('a[href=\"{link}\"]').click()")
        opened.settle()
        assert opened.evaluate("location.hash") == link
        assert opened.evaluate(f"document.querySelector('{link}').getClientRects().length") > 0


def test_a_link_into_a_folded_record_unfolds_it(opened: Chromium) -> None:
    folded = "document.querySelector('#record-3')"
    assert opened.evaluate(f"{folded}.open") is False
    opened.evaluate("location.hash = '#record-3-output-1'")
    opened.wait(f"{folded}.open")
    opened.wait("document.querySelector('#record-3-output-1 path.line') !== null")


def test_the_keyboard_reaches_all_that_reacts_and_shows_where_it_is(opened: Chromium) -> None:
    reached: list[str] = []
    for _ in range(60):
        opened.key("Tab")
        kind = opened.evaluate(
            "(() => { const e = document.activeElement; const s = getComputedStyle(e);"
            "const role = e.getAttribute('role') ? '=' + e.getAttribute('role') : '';"
            "return [e.tagName.toLowerCase() + role, parseFloat(s.outlineWidth)]; })()"
        )
        reached.append(kind[0])
        assert kind[1] >= 2.0, f"nothing shows that {kind[0]} has the focus"
    assert {"a", "button", "svg=application", "summary"} <= set(reached)


def test_print_opens_every_record_and_draws_whole_static_figures(opened: Chromium) -> None:
    drag(opened, 0.4, 0.6)
    opened.send("Emulation.setEmulatedMedia", media="print")
    opened.evaluate("dispatchEvent(new Event('beforeprint'))")
    opened.settle()
    assert opened.evaluate("[...document.querySelectorAll('details')].every((d) => d.open)") is True
    shown = "(e) => e.getClientRects().length > 0"
    assert opened.evaluate(f"[...document.querySelectorAll('.chart')].some({shown})") is False
    assert opened.evaluate(f"[...document.querySelectorAll('.static')].every({shown})") is True
    opened.evaluate("dispatchEvent(new Event('afterprint'))")
    assert opened.evaluate("document.querySelector('#record-3').open") is False
    opened.send("Emulation.setEmulatedMedia", media="")
    assert opened.printed().startswith(b"%PDF")


def test_without_script_the_same_curves_stand_still(browser: Chromium, page: Path) -> None:
    browser.send("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.send("Page.navigate", url=page.as_uri())
        browser.wait("document.readyState === 'complete'")
        root = browser.send("DOM.getDocument")["root"]["nodeId"]
        drawing = browser.send("DOM.querySelector", nodeId=root, selector="#record-1-output-1 .static svg")[
            "nodeId"
        ]
        width = browser.send("DOM.getBoxModel", nodeId=drawing)["model"]["width"]
        assert width > 300
        assert browser.send("DOM.querySelectorAll", nodeId=root, selector=".chart")["nodeIds"] == []
    finally:
        browser.send("Emulation.setScriptExecutionDisabled", value=False)


@pytest.mark.parametrize("dark", [False, True])
def test_curves_and_letters_stand_out_of_the_page(browser: Chromium, page: Path, dark: bool) -> None:
    browser.open(page, dark=dark)
    browser.settle()
    ratio = """(() => {
      const light = (text) => {
        const c = text.match(/[\\d.]+/g).slice(0, 3).map((v) => v / 255)
          .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
        return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
      };
      const contrast = (a, b) => (Math.max(light(a), light(b)) + 0.05) / (Math.min(light(a), light(b)) + 0.05);
      const figure = document.querySelector('#record-1-output-1');
      const paper = getComputedStyle(figure.querySelector('.chart')).backgroundColor;
      const line = (of) => contrast(getComputedStyle(figure.querySelector('path.line.' + of)).stroke, paper);
      const page = getComputedStyle(document.body).backgroundColor;
      const text = (where) => contrast(getComputedStyle(document.querySelector(where)).color, page);
      return {lines: ['measured', 'before', 'reidentified', 'after'].map(line),
              texts: ['h1', 'figcaption', 'caption', 'nav a', '.reading'].map(text), page: light(page)};
    })()"""
    found = browser.evaluate(ratio)
    # The Web Content Accessibility Guidelines ask 3 of graphics and 4.5 of text.
    assert min(found["lines"]) >= 3.0
    assert min(found["texts"]) >= 4.5
    assert (found["page"] < 0.2) is dark
