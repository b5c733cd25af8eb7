"""What does the docstring of an effect's file say, part by part?"""

from __future__ import annotations

import importlib
import inspect
import re
from dataclasses import dataclass

from rigsight.effects import Effect

_HEADING = "Equation\n--------\n"


@dataclass(frozen=True)
class EffectText:
    """The parts of a docstring, as Markdown.

    Attributes
    ----------
    title
        Its first sentence, without the period.
    equation
        The equation as written, with what is said of its symbols.
    applies
        When it applies and when not.
    signature
        By what it shows itself.
    references
        Where it comes from.
    """

    title: str
    equation: str
    applies: str
    signature: str
    references: str


def effect_text(effect: Effect) -> EffectText:
    """Return what the file of an effect says of it.

    Raises
    ------
    ValueError
        If a part is missing.
    """
    text = inspect.getdoc(importlib.import_module(f"rigsight.effects.{effect.name}")) or ""
    title, _, rest = text.partition("\n\n")
    blocks = [_markdown(block) for block in rest.replace(_HEADING, "").strip().split("\n\n")]
    parts: dict[str, list[str]] = {"equation": [], "applies": [], "signature": [], "references": []}
    current = "equation"
    for block in blocks:
        for part, opening in (
            ("applies", "Applies to"),
            ("signature", "Signature:"),
            ("references", "References:"),
        ):
            if block.startswith(opening):
                current = part
        parts[current].append(block)
    missing = [part for part, found in parts.items() if not found]
    if missing or _HEADING not in text:
        raise ValueError(
            f"The docstring of {effect.name} says nothing under: {', '.join(missing) or 'Equation'}."
        )
    for p in effect.parameters:
        parts["equation"] = [re.sub(rf"^{p.name}(?=: )", f"`{p.name}`", block) for block in parts["equation"]]
    joined = {part: "\n\n".join(found) for part, found in parts.items()}
    for part in ("signature", "references"):
        opened = joined[part].partition(":")[2].strip()
        joined[part] = opened[:1].upper() + opened[1:]
    return EffectText(title=" ".join(title.split()).rstrip("."), **joined)


def _markdown(block: str) -> str:
    """Return a paragraph or a simple table of reStructuredText as Markdown."""
    lines = block.strip("\n").splitlines()
    if not re.fullmatch(r"=+\s+=+", lines[0]):
        return re.sub(r"``(.+?)``", r"`\1`", block.strip(), flags=re.DOTALL)
    width = lines[0].index(" ")
    rows = [(line[:width].strip(), line[width:].strip()) for line in lines if not line.startswith("==")]
    return "\n".join(f"- `{symbol}`: {_markdown(meaning)}" for symbol, meaning in rows)
