"""Where on the site is a file of the repository, and how does a page there link to it?

Pages are written for the repository's own web view: links are relative paths of files. On the site some of these files are pages
under another path, some are generated, and some are not there at all; a link to such a one becomes the file's path in words.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Collection
from pathlib import Path

ROOT = Path(__file__).parents[2]
_LINK = re.compile(r"\[(?P<text>[^\]]+)\]\((?P<target>[^)\s]+)\)")
_FENCE = re.compile(r"(^```.*?^```)", re.DOTALL | re.MULTILINE)

MOVED = {
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "experiments/amplitudes/README.md": "experiments/amplitudes.md",
    "experiments/blind_cheat/README.md": "experiments/blind_cheat.md",
    "experiments/blind_handwritten/README.md": "experiments/blind_handwritten.md",
    "experiments/blind_laboratory/README.md": "experiments/blind_laboratory.md",
    "experiments/blind_standard/README.md": "experiments/blind_standard.md",
    "experiments/fuzzing/README.md": "experiments/fuzzing.md",
    "experiments/linear_recovery/README.md": "experiments/linear_recovery.md",
    "experiments/engine_accuracy/README.md": "experiments/engine_accuracy.md",
    "experiments/rounding/README.md": "experiments/rounding.md",
    "experiments/bam/README.md": "experiments/bam.md",
    "experiments/robots/README.md": "experiments/robots.md",
    "experiments/simulators/README.md": "experiments/simulators.md",
    "experiments/sensitivities/README.md": "experiments/sensitivities.md",
    "experiments/places/README.md": "experiments/places.md",
    "experiments/plan/README.md": "experiments/plan.md",
    "experiments/adequacy/README.md": "experiments/adequacy.md",
    "experiments/gate/README.md": "experiments/gate.md",
    "experiments/calibration/README.md": "experiments/calibration.md",
    "experiments/matrix/README.md": "experiments/matrix.md",
    "experiments/missing_force/README.md": "experiments/missing_force.md",
    "experiments/evidence/README.md": "experiments/evidence.md",
    "experiments/coverage/README.md": "experiments/coverage.md",
    "experiments/any_rig_start/README.md": "experiments/any_rig_start.md",
    "experiments/boards/README.md": "experiments/boards.md",
    "experiments/thesis/README.md": "experiments/thesis.md",
}
"""Files outside docs/ that are pages: their path in the repository -> that on the site."""


def place_on_site(path: str) -> str | None:
    """Return the source path of the page that stands for a file of the repository, None where there is none.

    Parameters
    ----------
    path
        Path from the root of the repository: ``"src/rigsight/effects/backlash.py"`` is ``"effects/backlash.md"``.
    """
    if path in MOVED:
        return MOVED[path]
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    if path == "src/rigsight/effects":
        return "effects/index.md"
    found = re.fullmatch(r"src/rigsight/effects/(\w+)\.py", path)
    if found and found[1] not in ("__init__", "catalogue", "effect", "numbers", "symbols"):
        return f"effects/{found[1]}.md"
    package = re.fullmatch(r"src/rigsight/(\w+?)(?:\.py)?", path)
    return f"reference/{package[1]}.md" if package else None


def place_in_repository(page: str) -> str:
    """Return the path in the repository of a page's source."""
    return next((path for path, place in MOVED.items() if place == page), f"docs/{page}")


def with_site_links(markdown: str, page: str, known: Collection[str]) -> str:
    """Return a page's text with its links to files of the repository turned into links on the site.

    Parameters
    ----------
    markdown
        The text.
    page
        Its own source path on the site.
    known
        Source paths of all pages and files of the site.
    """
    folder = posixpath.dirname(place_in_repository(page))

    def turned(link: re.Match[str]) -> str:
        target, _, anchor = link["target"].partition("#")
        if not target or "://" in target or target.startswith("mailto:"):
            return link[0]
        path = posixpath.normpath(posixpath.join(folder, target))
        place = place_on_site(path)
        if place is None or place not in known:
            if not (ROOT / path).exists():
                # Left as it is, for mkdocs to complain of.
                return link[0]
            text = link["text"]
            return text if path in text else f"{text} (`{path}`)"
        relative = posixpath.relpath(place, posixpath.dirname(page) or ".")
        return f"[{link['text']}]({relative}{'#' + anchor if anchor else ''})"

    return "".join(
        part if part.startswith("```") else _LINK.sub(turned, part) for part in _FENCE.split(markdown)
    )
