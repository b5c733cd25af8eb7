"""The pages on measured files: bring them, see their channels with units and plots."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import quote

from nicegui import ui

from rigsight.app import jobs
from rigsight.app.page_parts import address_of, page_of, run_panel, telling, text, watch
from rigsight.app.steps import OWN_EFFECTS, ROBOT_SUFFIXES, Site, inspection_key, picture_of
from rigsight.app.workspace import inside, set_aside
from rigsight.records.formats.known import LARGEST_FILE
from rigsight.workflow.init import MEASURED_SUFFIXES, measured_files

_UPLOAD = (Path(__file__).parent / "upload.js").read_text(encoding="utf-8")
_FURTHER = (".toml", OWN_EFFECTS, *ROBOT_SUFFIXES)
_HEADINGS = ("channel", "unit", "samples", "minimum", "maximum", "not finite")


def files_page(site: Site) -> None:
    """Show the files of the folder and take further ones."""
    with page_of(site, "/", "Files"):
        text(
            "p",
            "Measured files, a rig file, the model of a robot or effects of your own in Python: drop them anywhere on this "
            "page, or choose them.",
        )
        accepted = ",".join((*MEASURED_SUFFIXES, *_FURTHER))
        ui.html(
            f'<div class="drop"><label for="files">Files</label> '
            f'<input type="file" id="files" multiple accept="{accepted}"> up to {LARGEST_FILE / 1e9:g} GB each'
            '<progress id="upload-progress" max="1" value="0" aria-label="Upload" hidden></progress>'
            '<p id="upload-status" role="status"></p></div>',
            sanitize=False,
        )
        ui.add_body_html(f"<script>{_UPLOAD}</script>")

        @ui.refreshable
        def listed() -> None:
            files = _listed(site)
            if not files:
                text("p", "This folder holds no such file yet.")
                return
            with ui.element("table").props('aria-label="Files"'):
                _row("th", ("file", "size", "", ""))
                for name, size, is_measured in files:
                    _file_row(site, name, size, is_measured)

        listed()
        watch(lambda: _listed(site), listed.refresh)
        ui.link("Next: the rig", "/rig").classes("next")


def _listed(site: Site) -> list[tuple[str, int, bool]]:
    measured = {file.name for file in measured_files(site.root)}
    names = sorted(measured.union(site.files(*_FURTHER)))
    return [(name, (site.root / name).stat().st_size, name in measured) for name in names]


def _file_row(site: Site, name: str, size: int, is_measured: bool) -> None:
    def remove() -> None:
        with telling():
            ui.notify(f"Moved to {set_aside(site.root, name)}.")

    with ui.element("tr"):
        text("td", name)
        text("td", f"{size / 1e3:,.1f} kB", "number")
        with ui.element("td"):
            if is_measured:
                ui.link("Channels", f"/file?name={quote(name)}").props(f'aria-label="Channels of {name}"')
        with ui.element("td"):
            ui.button("Remove", on_click=remove).props(f'flat dense no-caps aria-label="Remove {name}"')


def _row(tag: str, cells: tuple[str, ...]) -> None:
    with ui.element("tr"):
        for cell in cells:
            text(tag, cell)


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

        run_panel(
            site, key, "Inspect again", lambda: site.inspection(name), channels.refresh, shows_output=False
        )
        channels()
        ui.link("All files", "/").classes("next")


def _channels(site: Site, name: str, found: dict[str, Any]) -> None:
    text("h2", f"{len(found['channels'])} channels ({found['format']})")
    with ui.element("table").props('aria-label="Channels"'):
        _row("th", _HEADINGS)
        for one in found["channels"]:
            ends = ("" if one[end] is None else f"{one[end]:.5g}" for end in ("minimum", "maximum"))
            _row(
                "td",
                (
                    one["name"],
                    one["unit"] or "",
                    str(one["n_samples"]),
                    *ends,
                    str(one["n_not_finite"] or ""),
                ),
            )
    for one in found["channels"]:
        for remark in one["remarks"]:
            text("p", f"'{one['name']}' {remark}.")
    for one in found["refused"]:
        text("p", f"No signal: '{one['name']}' {one['reason']}")
    version = (site.root / picture_of(name)).stat().st_mtime_ns
    ui.element("img").props(
        f'src="{address_of(picture_of(name))}?{version}" alt="Plots of the channels of {name}"'
    )
    text("h2", f"In a campaign, with the rig '{found['proposal']['model']}'")
    text("pre", found["proposal"]["toml"]).props('tabindex="0" aria-label="Proposed entry"')
