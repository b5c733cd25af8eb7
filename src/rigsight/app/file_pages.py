"""The pages on measured files: bring them, see their channels with units and plots."""

from __future__ import annotations

import json
from collections.abc import Container
from pathlib import Path
from typing import Any
from urllib.parse import quote

from nicegui import ui

from rigsight.app import jobs
from rigsight.app.page_parts import (
    address_of,
    next_step,
    page_of,
    run_panel,
    telling,
    text,
    watch,
    with_attributes,
)
from rigsight.app.steps import OWN_EFFECTS, ROBOT_SUFFIXES, Site, inspection_key, picture_of
from rigsight.app.workspace import inside, set_aside
from rigsight.records.formats.known import LARGEST_FILE, MEASURED_SUFFIXES

_UPLOAD = (Path(__file__).parent / "upload.js").read_text(encoding="utf-8")
_FURTHER = {
    ".toml": "rig file",
    OWN_EFFECTS: "effects of your own",
    **dict.fromkeys(ROBOT_SUFFIXES, "model of a robot"),
}
_OTHER = "not read, unless another file names it"
_WORDS = (
    "rigsight names what the simulation of a rig lacks, by comparing it with measurements. The steps on the left lead there, "
    "from top to bottom. Everything is kept in this folder.",
    "Begin with what your logger wrote: files with columns for time, inputs and sensors.",
)
_KINDS = (
    f"Measured files: {', '.join(MEASURED_SUFFIXES)}, up to {LARGEST_FILE / 1e9:g} GB each. If you have them: a rig file "
    f"(.toml), the model of a robot ({', '.join(ROBOT_SUFFIXES)}), effects of your own in Python ({OWN_EFFECTS})."
)
_HEADINGS = ("channel", "unit", "samples", "minimum", "maximum", "not finite")
_NUMBERS = range(2, len(_HEADINGS))


def files_page(site: Site) -> None:
    """Show the files of the folder and take further ones."""
    with page_of(site, "/", "Files"):
        for words in _WORDS:
            text("p", words)
        accepted = ",".join((*MEASURED_SUFFIXES, *_FURTHER))
        ui.html(
            f'<div class="drop"><label for="files">Drop files anywhere on this page, or choose them:</label> '
            f'<input type="file" id="files" multiple accept="{accepted}">'
            '<progress id="upload-progress" max="1" value="0" aria-label="Upload" hidden></progress>'
            '<p id="upload-status" role="status"></p></div>',
            sanitize=False,
        )
        text("p", _KINDS, "hint")
        ui.add_body_html(f"<script>{_UPLOAD}</script>")

        @ui.refreshable
        def listed() -> None:
            files = _listed(site)
            if not files:
                text("p", "This folder holds no file yet.")
                return
            with ui.element("table").props('aria-label="Files"'):
                _row("th", ("file", "size", "what it is", ""), numbers=(1,))
                for name, size in files:
                    _file_row(site, name, size)

        listed()
        watch(lambda: _listed(site), listed.refresh)
        next_step(site, "/")


def _listed(site: Site) -> list[tuple[str, int]]:
    return [(name, (site.root / name).stat().st_size) for name in site.files()]


def _file_row(site: Site, name: str, size: int) -> None:
    def remove() -> None:
        with telling():
            ui.notify(f"Moved to {set_aside(site.root, name)}.")

    with ui.element("tr"):
        text("td", name)
        text("td", f"{size / 1e3:,.1f} kB", "number")
        with ui.element("td"):
            if (suffix := Path(name).suffix.lower()) in MEASURED_SUFFIXES:
                link = ui.link("Channels", f"/file?name={quote(name)}")
                with_attributes(link, aria_label=f"Channels of {name}")
            else:
                text("span", _FURTHER.get(suffix, _OTHER))
        with ui.element("td"):
            button = ui.button("Remove", on_click=remove).props("flat dense no-caps")
            with_attributes(button, aria_label=f"Remove {name}")


def _row(tag: str, cells: tuple[str, ...], numbers: Container[int] = ()) -> None:
    with ui.element("tr"):
        for place, cell in enumerate(cells):
            text(tag, cell, "number" if place in numbers else "")


def file_page(site: Site, name: str) -> None:
    """Show the channels of one file."""
    with page_of(site, "/", f"Channels of {name}"):
        if inside(site.root, name) is None:
            text("p", "There is no such file in this folder.")
            return
        key = inspection_key(name)
        job = jobs.find(site.root, key)
        with telling():
            if job is None or (not job.is_running and job.started < (site.root / name).stat().st_mtime):
                jobs.start(site.root, key, site.inspection(name))

        @ui.refreshable
        def channels() -> None:
            job = jobs.find(site.root, key)
            if job is not None and job.exit_code == 0:
                _channels(site, name, json.loads((job.folder / "stdout").read_text(encoding="utf-8")))

        channels()
        run_panel(site, key, "Inspect", lambda: site.inspection(name), channels.refresh, shows_output=False)
        ui.link("All files", "/").classes("next")


def _channels(site: Site, name: str, found: dict[str, Any]) -> None:
    text("h2", f"{len(found['channels'])} channels ({found['format']})")
    with ui.element("table").props('aria-label="Channels"'):
        _row("th", _HEADINGS, numbers=_NUMBERS)
        for one in found["channels"]:
            ends = ("" if one[end] is None else f"{one[end]:.5g}" for end in ("minimum", "maximum"))
            _row(
                "td",
                (
                    one["name"],
                    one["unit"] or "",
                    str(one["n_samples"]),
                    *ends,
                    str(one["n_not_finite"]),
                ),
                numbers=_NUMBERS,
            )
    for one in found["channels"]:
        for remark in one["remarks"]:
            text("p", f"'{one['name']}' {remark}.")
    for one in found["refused"]:
        text("p", f"No signal: '{one['name']}' {one['reason']}")
    for note in found["notes"]:
        text("p", f"Note: {note}")
    version = (site.root / picture_of(name)).stat().st_mtime_ns
    source = f"{address_of(picture_of(name))}?{version}"
    with_attributes(ui.element("img"), src=source, alt=f"Plots of the channels of {name}")
    text("h2", "Its entry in a campaign")
    text(
        "p",
        f"As the rig '{found['proposal']['model']}' would read it, which fits these columns best. The next step writes such an "
        "entry for every file, for the rig that you choose.",
    )
    text("pre", found["proposal"]["toml"], "message").props('tabindex="0" aria-label="Proposed entry"')
