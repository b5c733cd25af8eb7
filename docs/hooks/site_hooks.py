"""What of the site is made when it is built: the pages of the effects, the reference, pages from elsewhere in the repository.

mkdocs calls the functions that begin with `on_`; `mkdocs.yml` names this file.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from effect_figures import figures
from effect_pages import effect_page, index_page
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from policy_page import policy_page
from reference_pages import BENCH, PACKAGES, bench_page, reference_index, reference_page
from repository_links import MOVED, with_site_links

from rigsight.effects import CATALOGUE
from rigsight.report.labels import effect_label, sentence_case

ROOT = Path(__file__).parents[2]
NUMBERS = "verdict_numbers.md"
STANDARD_BENCH = "blind.md"
"""Written by `make blind`, hours long: not there in every copy of the repository."""
_SECTION = re.compile(r"<!-- section (?P<file>\S+) (?P<heading>[^>]+?) -->")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the generated pages where the navigation names their section."""
    effects = [{sentence_case(effect_label(e.name)): f"effects/{e.name}.md"} for e in CATALOGUE]
    sections = {
        "effects/index.md": [{"All effects": "effects/index.md"}, *effects],
        "reference/index.md": [
            {"Overview": "reference/index.md"},
            *({f"rigsight.{name}": f"reference/{name}.md"} for name in PACKAGES),
            {BENCH.name: f"reference/{BENCH.name}.md"},
        ],
    }
    config.nav = [_filled(entry, sections) for entry in config.nav or ()]
    if (ROOT / "docs" / STANDARD_BENCH).exists():
        (evidence,) = (entry for entry in config.nav if "Evidence" in entry)
        evidence["Evidence"].insert(3, {"The standard bench": STANDARD_BENCH})
    return config


def _filled(entry: Any, sections: dict[str, list[dict[str, str]]]) -> Any:
    if not isinstance(entry, dict):
        return entry
    return {
        title: sections.get(content, content) if isinstance(content, str) else content
        for title, content in entry.items()
    }


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what is generated."""
    pages = {
        "effects/index.md": index_page(),
        "reference/index.md": reference_index(),
        NUMBERS: policy_page(),
    }
    pages |= {f"reference/{name}.md": reference_page(name) for name in PACKAGES}
    pages[f"reference/{BENCH.name}.md"] = bench_page()
    for effect in CATALOGUE:
        pages[f"effects/{effect.name}.md"] = effect_page(effect)
        for end, picture in figures(effect).items():
            pages[f"effects/{effect.name}-{end}.svg"] = picture
    for path, place in MOVED.items():
        pages[place] = (ROOT / path).read_text(encoding="utf-8")
    for place, content in pages.items():
        files.append(File.generated(config, place, content=content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:  # noqa: ARG001
    """Put in the sections of other files that a page asks for, and turn its links."""
    filled = _SECTION.sub(lambda found: section(ROOT / found["file"], found["heading"]), markdown)
    return with_site_links(filled, page.file.src_uri, files.src_uris)


def section(file: Path, heading: str) -> str:
    """Return what stands under a heading of a Markdown file, up to the next of its kind.

    Raises
    ------
    ValueError
        If there is no such heading.
    """
    text = file.read_text(encoding="utf-8")
    found = re.search(rf"^(#+) {re.escape(heading)}\n(.*?)(?=^#+ |\Z)", text, re.MULTILINE | re.DOTALL)
    if found is None:
        raise ValueError(f"{file} has no heading '{heading}'.")
    return found[2].strip()
