"""How does a matplotlib figure get into the page? As SVG inside it, or as PNG where that is smaller."""

from __future__ import annotations

import base64
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from markupsafe import Markup, escape

from rigsight.plot import png_bytes, svg_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LARGEST_SVG = 300_000
_PNG_DPI = 220
_ID = re.compile(r' id="([^"]+)"')
_REFERENCE = re.compile(r'(url\(#|xlink:href="#)([^")]+)')
_NOISE = re.compile(r"<metadata>.*?</metadata>|<!--.*?-->", re.DOTALL)
_NAMESPACES = re.compile(r' xmlns(:xlink)?="[^"]*"')
_SIZE = re.compile(r'(<svg\b[^>]*?) width="[^"]*"([^>]*?)')
_PATH = re.compile(r'(?<=\bd=")[^"]+')
_PLACE = re.compile(r'(?<= [xy]=")[^"]+')
_BEFORE_LETTER = re.compile(r" ?([A-Za-z]) ?")
_BETWEEN_TAGS = re.compile(r">\s+<")
_DIGITS = re.compile(r"(\.\d\d)\d+")
_HEIGHT = re.compile(r'(<svg\b[^>]*?) height="[^"]*"')


@dataclass(frozen=True)
class PageFigure:
    """A figure as it stands in the page."""

    key: str  # its id, unique in the page
    image: Markup  # ``<svg>`` or ``<img>``
    caption: str  # what it shows, for everyone


def page_figure(figure: Figure, key: str, alt: str, caption: str) -> PageFigure:
    """Return a figure for the page."""
    svg = _svg(figure, key, alt)
    image = svg if len(svg) <= _LARGEST_SVG else _png(figure, alt)
    return PageFigure(key, image, caption)


def _svg(figure: Figure, key: str, alt: str) -> Markup:
    text = svg_text(figure, key)
    text = _NOISE.sub("", text[text.index("<svg") :])
    text = _NAMESPACES.sub("", text)
    # Ids of matplotlib repeat from figure to figure; in one page they must not. Most of them nothing refers to.
    needed = {name for _, name in _REFERENCE.findall(text)}
    text = _ID.sub(lambda found: f' id="{key}-{found[1]}"' if found[1] in needed else "", text)
    text = _REFERENCE.sub(rf"\g<1>{key}-\2", text).replace("xlink:href", "href")
    text = _HEIGHT.sub(r"\1", _SIZE.sub(r"\1\2", text, count=1), count=1)
    # A hundredth of a point is finer than any screen or printer; matplotlib writes a millionth.
    text = _PLACE.sub(lambda place: _DIGITS.sub(r"\1", place[0]), _PATH.sub(_short_path, text))
    text = _BETWEEN_TAGS.sub("><", text)
    # The page's own sans serif face, where DejaVu is missing.
    text = text.replace("'DejaVu Sans'", "'DejaVu Sans', Verdana, sans-serif")
    label = escape(alt)
    return Markup(text.replace("<svg", f'<svg role="img" aria-label="{label}"', 1).strip())


def _short_path(path: re.Match[str]) -> str:
    return _BEFORE_LETTER.sub(r"\1", _DIGITS.sub(r"\1", " ".join(path[0].split())))


def _png(figure: Figure, alt: str) -> Markup:
    data = base64.b64encode(png_bytes(figure, _PNG_DPI)).decode("ascii")
    return Markup('<img alt="{}" src="data:image/png;base64,{}">').format(alt, data)
