"""What all pages and pieces of pages are rendered with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from itertools import chain
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from rigsight.report import labels

NotebookTable = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Heads, which may be none, and rows of texts; the first cell of a row is its label."""


def rendered(
    template: str, command: str, versions: Mapping[str, str], seed: int | None = None, **content: Any
) -> str:
    """Return a page that ends with how it was made."""
    page = environment().get_template(template)
    return page.render(command=command, versions=versions, seed=seed, made=datetime.now(UTC), **content)


def notebook_html(
    title: str, sentences: Iterable[str], tables: Sequence[NotebookTable], warnings: Sequence[str] = ()
) -> str:
    """Return a small self-contained piece of a page, for a notebook."""
    return (
        environment()
        .get_template("notebook.html.jinja")
        .render(title=title, sentences=[s for s in sentences if s], tables=tables, warnings=warnings)
    )


def environment(*packages: str) -> Environment:
    """Return what all pages are rendered with."""
    made = Environment(
        loader=ChoiceLoader([PackageLoader(name) for name in ("rigsight.report", *packages)]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    made.filters |= {
        "unit": _unit,
        "number": _number,
        "percent": labels.percent,
        "gap": labels.gap_percent,
        "case": labels.sentence_case,
        "effects": lambda names: labels.sentence_case(labels.effects_label(names)),
        "is_finite": math.isfinite,
        "shift": labels.shift_text,
        "arrows": lambda text: text.replace("->", "\u2192"),
        "floors": lambda error: f"{error:.3g} {labels.TIMES}" if math.isfinite(error) else "not scored",
        # The heads of a table: title -> class of its column.
        "merged": lambda heads, *more: dict(chain(heads.items(), *(own.items() for own in more))),
    }
    made.globals["numeric"] = lambda names, before="": {f"{before}{name}": "n" for name in names}
    return made


def _unit(unit: str) -> Markup:
    """Return a unit with its exponents raised; nothing for a dimensionless one."""
    if unit in ("", "1"):
        return Markup("")
    parts = str(escape(unit)).split("^")
    raised = [parts[0]]
    for part in parts[1:]:
        digits = len(part) - len(part.lstrip("-0123456789"))
        raised.append(f"<sup>{part[:digits].replace('-', '&minus;')}</sup>{part[digits:]}")
    return Markup("".join(raised))


def _number(number: labels.Written) -> Markup:
    """Return a number as ``(3.100 ± 0.020) · 10<sup>5</sup>``."""
    text = escape(number.value.replace("-", "\u2212"))
    if number.std:
        text = Markup("{} ± {}").format(text, number.std)
    if not number.exponent:
        return text
    brackets = Markup("({})") if number.std else Markup("{}")
    power = str(number.exponent).replace("-", "\u2212")
    return brackets.format(text) + Markup(" · 10<sup>{}</sup>").format(power)
