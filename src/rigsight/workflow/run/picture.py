"""Write the PNG or SVG file that `--picture` names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rigsight.errors import check_option
from rigsight.workflow.run.results import check_target, write_together


def write_picture(file: Path, draw: Callable[[str], str | bytes]) -> Path:
    """Write what is drawn for the suffix of a file, once it is clear that the file can be written."""
    suffix = check_option("The suffix of a picture", file.suffix.lower(), (".png", ".svg"))
    check_target(file)
    return write_together(file.parent, {file.name: draw(suffix)})[0]
