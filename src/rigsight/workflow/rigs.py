"""The work of `rigsight rigs --picture`: a rig -> its picture in a file."""

from __future__ import annotations

import io
from pathlib import Path

from rigsight.errors import check_option
from rigsight.plot import rig_picture, style, svg_text
from rigsight.rigs import Rig
from rigsight.workflow.run.results import check_target, write_together

_DPI = 200


def write_rig_picture(rig: Rig, file: Path) -> Path:
    """Draw a rig into a PNG or SVG file."""
    ending = check_option("The suffix of a picture", file.suffix.lower(), (".png", ".svg"))
    check_target(file)
    figure = rig_picture(rig)
    content: str | bytes
    if ending == ".svg":
        content = svg_text(figure, rig.name)
    else:
        stream = io.BytesIO()
        with style():
            figure.savefig(stream, format="png", dpi=_DPI)
        content = stream.getvalue()
    return write_together(file.parent, {file.name: content})[0]
