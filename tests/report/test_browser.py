"""The page in a real browser: it opens without a complaint, its plots react, it fits a phone, it prints whole."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigsight.diagnose.result import Diagnosis
from rigsight.report.render import render_report

from ..chromium import BROWSERS, Chromium, find

pytestmark = pytest.mark.release
FIRST = "document.querySelector('#record-1-output-1')"
CURVE = f"{FIRST}.querySelectorAll('.u-legend th')[2]"
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


def over(figure: str) -> str:
    """Return the surface of the upper panel, which the pointer and keys act on."""
    return f"{figure}.querySelector('.u-over')"


def place(chromium: Chromium, share: float, figure: str = FIRST) -> tuple[float, float]:
    """Return a point of the plot, at a share of its width, in the window."""
    chromium.evaluate(f"{over(figure)}.scrollIntoView({{block: 'center', behavior: 'instant'}})")
    chromium.settle()
    left, top, width, height = chromium.evaluate(
        f"(() => {{ const r = {over(figure)}.getBoundingClientRect();"
        "return [r.left, r.top, r.width, r.height]; })()"
    )
    return left + min(share * width, width - 1), top + 0.3 * height


def reading(chromium: Chromium, figure: str = FIRST) -> dict[str, str]:
    """Return what the legend of the upper panel says at the cursor, by name of the curve."""
    chromium.settle()
    return dict(
        chromium.evaluate(
            f"[...{figure}.querySelector('.u-legend').querySelectorAll('tr')].map((row) =>"
            "[row.querySelector('th').textContent, row.querySelector('td').textContent])"
        )
    )


def number(text: str) -> float:
    return float(text.replace("\u2212", "-"))


def seen(chromium: Chromium, figure: str = FIRST) -> tuple[float, float]:
    """Return the part of the axis that is seen, as read with the pointer at its ends."""
    found = []
    for share in (0.5, 0.0, 1.0):
        chromium.mouse("mouseMoved", *place(chromium, share, figure), button="none")
        found.append(number(next(iter(reading(chromium, figure).values()))))
    return found[1], found[2]


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
    # One record is folded: it has no width yet.
    assert opened.evaluate("document.querySelectorAll('figure.reacting:has(canvas)').length") == 5


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


def test_dragging_zooms_both_panels_and_a_double_click_shows_all_again(opened: Chromium) -> None:
    whole = seen(opened)
    assert whole == pytest.approx((0.0, 9.995), abs=0.02)
    lower = f"{{querySelector: (x) => {FIRST}.querySelectorAll('.uplot')[1].querySelector(x)}}"
    drag(opened, 0.4, 0.6)
    # Ten seconds in all: what was dragged over is 4 s to 6 s.
    assert seen(opened) == pytest.approx((4.0, 6.0), abs=0.03)
    assert seen(opened, f"({lower})") == pytest.approx((4.0, 6.0), abs=0.03)
    x, y = place(opened, 0.5)
    for count in (1, 2):
        opened.mouse("mousePressed", x, y, clickCount=count)
        opened.mouse("mouseReleased", x, y, clickCount=count)
    assert seen(opened) == whole


def test_a_logarithmic_axis_zooms_by_ratios(opened: Chromium) -> None:
    low, high = seen(opened, RESPONSE)
    drag(opened, 0.0, 0.5, RESPONSE)
    # Half of the axis from its left is the square root of the ratio; what is read is the line next to it.
    assert seen(opened, RESPONSE) == pytest.approx((low, (low * high) ** 0.5), rel=0.15)


def test_keys_read_values_and_switch_curves(opened: Chromium) -> None:
    opened.evaluate(f"{over(FIRST)}.focus()")
    opened.key("ArrowRight")
    first = reading(opened)
    opened.key("ArrowRight")
    assert number(first["time [s]"]) < number(reading(opened)["time [s]"]) < number(first["time [s]"]) + 0.2
    opened.evaluate(f"{CURVE}.focus()")
    opened.key("Enter")
    assert opened.evaluate(f"{CURVE}.getAttribute('aria-pressed')") == "false"


def test_the_pointer_reads_the_value_of_the_record(opened: Chromium, diagnosis: Diagnosis) -> None:
    opened.mouse("mouseMoved", *place(opened, 0.24), button="none")
    opened.mouse("mouseMoved", *place(opened, 0.25), button="none")
    found = reading(opened)
    assert list(found) == ["time [s]", "measured", "given simulation", "re-identified", "with effect"]
    trace = next(trace for trace in diagnosis.traces if trace.record == "sweep_A0.75.csv")
    index = round(number(found["time [s]"]) / 0.005)
    assert number(found["measured"]) == pytest.approx(1e3 * trace.measured["psi"][index], rel=1e-3)
    assert number(found["given simulation"]) == pytest.approx(1e3 * trace.before["psi"][index], rel=1e-3)


def test_a_curve_can_be_taken_away_from_both_panels(opened: Chromium) -> None:
    off = f"{FIRST}.querySelectorAll('.u-series.u-off').length"
    pictures = f"[...{FIRST}.querySelectorAll('canvas')].map((one) => one.toDataURL())"
    assert opened.evaluate(f"{CURVE}.getAttribute('aria-pressed')") == "true"
    before = opened.evaluate(pictures)
    opened.evaluate(f"{CURVE}.click()")
    opened.settle()
    assert opened.evaluate(f"{CURVE}.getAttribute('aria-pressed')") == "false"
    assert opened.evaluate(off) == 2
    assert all(old != new for old, new in zip(before, opened.evaluate(pictures), strict=True))
    opened.evaluate(f"{CURVE}.click()")
    opened.settle()
    assert opened.evaluate(off) == 0
    assert opened.evaluate(pictures) == before


def test_buttons_zoom_without_a_mouse_or_keys(opened: Chromium) -> None:
    whole = seen(opened)
    press = f"[...{FIRST}.querySelectorAll('button')].find((b) => b.textContent === '%s').click()"
    opened.evaluate(press % "Largest error")
    low, high = seen(opened)
    assert high - low < 0.5 * (whole[1] - whole[0])
    opened.evaluate(press % "\u2212")
    assert np.ptp(seen(opened)) == pytest.approx(2.0 * (high - low), rel=0.05)
    opened.evaluate(press % "All")
    assert seen(opened) == whole
    opened.evaluate(press % "+")
    assert seen(opened) == pytest.approx((2.5, 7.5), abs=0.05)
    # It goes no farther than to the end, and what is seen stays as long as it was.
    for _ in range(3):
        opened.evaluate(press % "\u25b8")
    assert seen(opened) == pytest.approx((5.0, 9.995), abs=0.05)


def test_a_phone_shows_it_without_scrolling_sideways_and_a_finger_zooms(
    browser: Chromium, page: Path
) -> None:
    browser.open(page, 400, 800, touch=True)
    browser.settle()
    assert browser.complaints() == []
    assert browser.evaluate("document.documentElement.scrollWidth") <= 400
    small = browser.evaluate(
        "[...document.querySelectorAll('button, [role=button]')].filter("
        "(b) => b.offsetParent && Math.min(b.offsetWidth, b.offsetHeight) < 24).length"
    )
    assert small == 0
    x, y = place(browser, 0.2)
    to, _ = place(browser, 0.5)
    browser.send("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
    for share in (0.25, 0.5, 0.75, 1.0):
        browser.send(
            "Input.dispatchTouchEvent", type="touchMove", touchPoints=[{"x": x + share * (to - x), "y": y}]
        )
    browser.send("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    assert seen(browser) == pytest.approx((2.0, 5.0), abs=0.1)


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
    opened.wait("document.querySelector('#record-3-output-1 canvas') !== null")


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
    assert {"a", "button", "div=application", "th=button", "summary"} <= set(reached)


def test_print_opens_every_record_and_draws_on_white(browser: Chromium, page: Path) -> None:
    browser.open(page, dark=True)
    browser.settle()
    browser.evaluate("dispatchEvent(new Event('beforeprint'))")
    browser.settle()
    assert browser.evaluate("[...document.querySelectorAll('details')].every((d) => d.open)") is True
    drawn = "[...document.querySelectorAll('figure.reacting')].every((f) => f.querySelectorAll('canvas').length === 2)"
    assert browser.evaluate(drawn) is True
    color = "getComputedStyle(document.documentElement).getPropertyValue('--panel')"
    assert browser.evaluate(color) == "#ffffff"
    browser.evaluate("dispatchEvent(new Event('afterprint'))")
    assert browser.evaluate("document.querySelector('#record-3').open") is False
    assert browser.evaluate(color) != "#ffffff"
    assert browser.printed().startswith(b"%PDF")


def test_without_script_pictures_of_the_scored_records_stand_still(browser: Chromium, page: Path) -> None:
    browser.send("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.send("Page.navigate", url=page.as_uri())
        browser.wait("document.readyState === 'complete'")
        root = browser.send("DOM.getDocument")["root"]["nodeId"]
        drawing = browser.send("DOM.querySelector", nodeId=root, selector="#record-1-output-1 noscript svg")[
            "nodeId"
        ]
        width = browser.send("DOM.getBoxModel", nodeId=drawing)["model"]["width"]
        assert width > 300
        assert browser.send("DOM.querySelectorAll", nodeId=root, selector="canvas")["nodeIds"] == []
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
      const lines = [...figure.querySelectorAll('.u-legend tr:not(:first-child):not(.area) .u-marker')]
        .filter((mark) => mark.offsetParent).map((mark) => contrast(getComputedStyle(mark).borderBottomColor, paper));
      const page = getComputedStyle(document.body).backgroundColor;
      const text = (where) => contrast(getComputedStyle(document.querySelector(where)).color, page);
      return {lines, texts: ['h1', 'figcaption', 'caption', 'nav a', '.u-legend th'].map(text), page: light(page)};
    })()"""
    found = browser.evaluate(ratio)
    # The Web Content Accessibility Guidelines ask 3 of graphics and 4.5 of text.
    assert len(found["lines"]) == 7
    assert min(found["lines"]) >= 3.0
    assert min(found["texts"]) >= 4.5
    assert (found["page"] < 0.2) is dark
