"""What every page consists of: heading and steps, a command with its run, files to take away, messages."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement
from nicegui.elements.mixins.value_element import ValueElement

from rigsight.app import jobs
from rigsight.app.steps import OWN_EFFECTS, Site
from rigsight.errors import RigsightError

_COLOR = "#0b5a91"
"""Of buttons; white on it can be read."""
_RUNS_CODE = (
    "A file chosen here is run: it can read, change and delete all that you can. "
    "Choose only files that you wrote or have read."
)
_EVERY = 0.5
"""Interval [s] at which a page looks into the folder."""
STYLE = (Path(__file__).parent / "pages.css").read_text(encoding="utf-8")


def text(tag: str, words: str, classes: str = "") -> TextElement:
    """Show words in an HTML element of their own."""
    return TextElement(tag=tag, text=words).classes(classes)


def with_attributes(element: ui.element, **attributes: str) -> ui.element:
    """Return an element with attributes whose values may hold any character, as names of files do; `props` would parse them."""
    element.props.update({name.replace("_", "-"): value for name, value in attributes.items()})
    return element


def address_of(path: str) -> str:
    """Return the address at which a file of the folder is served."""
    return f"/folder/{quote(path)}"


@contextlib.contextmanager
def telling() -> Iterator[None]:
    """Show an error on the page instead of ending the server's part of it."""
    try:
        yield
    except (RigsightError, OSError) as error:
        ui.notify(str(error), type="negative", timeout=0, close_button="Close", multi_line=True)


@contextlib.contextmanager
def page_of(site: Site, current: str, title: str) -> Iterator[None]:
    """Show the frame of a page: folder, steps, and room for what is on it."""
    ui.add_css(STYLE)
    ui.colors(primary=_COLOR)
    ui.page_title(f"{title} - {site.root.name} - rigsight")
    # Its own landmark would surround ours.
    ui.query("main.q-page").props("role=presentation")
    skip = ui.link("Skip to the page").classes("skip")
    with ui.element("header").classes("top"):
        ui.link("rigsight", "/").classes("name")
        text("span", str(site.root), "folder")
    with ui.element("div").classes("columns"):
        with ui.element("nav").props('aria-label="Steps"'):

            @ui.refreshable
            def steps() -> None:
                for number, step in enumerate(site.steps(), 1):
                    link = ui.link(f"{number} {step.title}", step.address)
                    if step.address == current:
                        link.props('aria-current="page"')
                    if step.state:
                        with link:
                            text("span", step.state, step.state)

            steps()
            watch(site.steps, steps.refresh)
        with ui.element("main").classes("content").props('tabindex="-1"') as main:
            with_attributes(skip, href=f"#{main.html_id}")
            text("h1", title)
            yield


def next_step(site: Site, current: str) -> None:
    """Link the step after this one."""
    following = next(after for step, after in pairwise(site.steps()) if step.address == current)
    ui.link(f"Next step: {following.title}", following.address).classes("next")


def watch(state: Callable[[], object], act: Callable[[], object]) -> None:
    """Act whenever what a function returns is no longer what it was."""
    seen = state()

    def look() -> None:
        nonlocal seen
        if (now := state()) != seen:
            seen = now
            act()

    ui.timer(_EVERY, look)


def command_shown(arguments: Sequence[str]) -> None:
    """Show a command, to be copied into a terminal."""
    line = jobs.shown(arguments)
    with ui.element("div").classes("command"):
        text("span", "The same in a terminal:", "hint")
        text("code", line)
        ui.button(icon="content_copy", on_click=lambda: _copied(line)).props(
            'flat dense aria-label="Copy the command"'
        )


def _copied(line: str) -> None:
    ui.clipboard.write(line)
    ui.notify("Copied.")


@dataclass(frozen=True)
class Option:
    """An option of a command that is asked for on a page."""

    element: ValueElement[Any]
    name: str

    @property
    def arguments(self) -> tuple[str, ...]:
        """The option with each of its values."""
        value = self.element.value
        values = value.split() if isinstance(value, str) else value or ()
        return tuple(part for own in values for part in (self.name, own))


def typed_option(site: Site, job: str, name: str, label: str) -> Option:
    """Ask for the values of an option, with those of the last run."""
    return Option(ui.input(label, value=" ".join(_last(site, job, name))).classes("wide"), name)


def own_effects_option(site: Site, job: str) -> Option | None:
    """Ask which Python files to run for effects of one's own, with a warning; None where there is no such file."""
    files = site.files(OWN_EFFECTS)
    if not files:
        return None
    chosen = [file for file in _last(site, job, "--effects") if file in files]
    field = ui.select(files, value=chosen, multiple=True, label="Effects of your own (optional)").classes(
        "wide"
    )
    text("p", _RUNS_CODE, "bad")
    return Option(field, "--effects")


def _last(site: Site, job: str, option: str) -> list[str]:
    """Return the values of an option in the last run of a command."""
    found = jobs.find(site.root, job)
    return [] if found is None else [own for name, own in pairwise(found.arguments) if name == option]


def run_panel(
    site: Site,
    name: str,
    label: str,
    arguments: Callable[[], Sequence[str]],
    ended: Callable[[], object] = lambda: None,
    shows_output: bool = True,
    is_open: bool = False,
) -> Callable[[], object]:
    """Show a command with its button, its run and its outcome; return what shows the command anew."""

    def state() -> tuple[float, bool] | None:
        job = jobs.find(site.root, name)
        return None if job is None else (job.started, job.is_running)

    def begin() -> None:
        with telling():
            jobs.start(site.root, name, arguments())
            show()

    @ui.refreshable
    def command() -> None:
        job = jobs.find(site.root, name)
        if job is not None and job.is_running:
            command_shown(job.arguments)
            return
        command_shown(arguments())
        ui.button(label if job is None else f"{label} again", on_click=begin)

    @ui.refreshable
    def outcome() -> None:
        job = jobs.find(site.root, name)
        if job is not None and job.is_running:
            _running(job)
        elif job is not None:
            _ended(job, shows_output, is_open)

    def show() -> None:
        command.refresh()
        tell()
        outcome.refresh()

    def tell() -> None:
        kind, status.text = _status(jobs.find(site.root, name))
        status.classes(replace=kind)

    def changed() -> None:
        show()
        if (now := state()) is not None and not now[1]:
            ended()

    with with_attributes(ui.element("section").classes("run"), aria_label=label):
        command()
        # It stays while the rest is drawn anew: a screen reader tells only what changes in an element that it knows.
        status = text("p", "").props('role="status"')
        tell()
        outcome()
        watch(state, changed)
    return lambda: command.refresh()


def _status(job: jobs.Job | None) -> tuple[str, str]:
    """Return the class and the words that tell how a run is."""
    if job is None:
        return "", ""
    if job.is_running:
        return "note", "Running ..."
    if job.exit_code is None:
        return "bad", "Ended without a result: its process was killed. Start it again."
    if job.exit_code == 0:
        return "good", "Done."
    return "bad", "Canceled." if job.exit_code in jobs.CANCELED else "Not done:"


def _running(job: jobs.Job) -> None:
    words = text("p", "")
    bar = ui.linear_progress(value=0.0, show_value=False).props(
        'aria-label="Progress" rounded size="10px" instant-feedback'
    )
    ui.button("Cancel", on_click=job.cancel).props("outline")
    notes = text("p", "", "message")

    def look() -> None:
        notes.text = "\n".join(job.messages())
        if (found := job.progress()) is not None:
            left = "" if found.seconds_left is None else f", {_time(found.seconds_left)} left in this part"
            words.text = f"{found.text}{left}"
            bar.value = found.share

    look()
    ui.timer(_EVERY, look)


def _time(seconds: float) -> str:
    return f"about {seconds:.0f} s" if seconds < 90 else f"about {seconds / 60:.0f} min"


def _ended(job: jobs.Job, shows_output: bool, is_open: bool) -> None:
    for message in job.messages():
        text("p", message, "message")
    if shows_output and (output := job.output):
        with ui.element("details").props("open" if is_open else ""):
            text("summary", "What the command printed")
            text("pre", output).props('tabindex="0" aria-label="Output of the command"')


def shown_page(site: Site, path: str, title: str) -> None:
    """Show a page of results inside of this one."""
    file = site.root / path
    if not file.is_file():
        return
    if site.is_outdated(path):
        text("p", "The campaign was changed after this result: run it again.", "bad").props('role="status"')
    ui.link("Open it in a window of its own", address_of(path), new_tab=True)
    # Without an origin of its own, what an uploaded file brought into a report cannot reach this server.
    frame = ui.element("iframe").props('sandbox="allow-scripts allow-downloads"')
    with_attributes(frame, src=f"{address_of(path)}?{file.stat().st_mtime_ns}", title=title)


def downloads(paths: Sequence[str]) -> None:
    """List files to take away, if there are any."""
    if not paths:
        return
    text("h2", "Files to download")
    with ui.element("ul").classes("files"):
        for path in paths:
            with ui.element("li"):
                link = ui.link(path, address_of(path)).props("download")
                with_attributes(link, aria_label=f"Download {path}")
