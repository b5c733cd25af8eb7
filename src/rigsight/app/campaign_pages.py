"""The pages on the campaign: choose the rig, which begins it, and edit its text with errors by line."""

from __future__ import annotations

import asyncio
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from nicegui import ui

from rigsight.app import jobs
from rigsight.app.page_parts import (
    address_of,
    next_step,
    page_of,
    run_panel,
    telling,
    text,
    typed_option,
    watch,
    with_attributes,
)
from rigsight.app.steps import ROBOT_SUFFIXES, Site, campaign_errors, picture_of
from rigsight.app.workspace import (
    CAMPAIGN,
    Draft,
    campaign_text,
    find_draft,
    keep_draft,
    save_campaign,
    set_aside,
)

_GUESS = ""
_OF_ROBOT = (
    ("--gear", "Compliant gears with their stiffness in N m/rad, such as elbow=500 wrist=200"),
    ("--lock", "Joints that a brake holds, and where in rad, such as elbow=0.5"),
)
_PICTURE = "picture"
_WORDS = (
    "This text says which column is which signal, and in which unit. Go through the comments (#): they mark what was guessed. "
    "Under [rig.parameters] type the values of your simulation and remove the # before them; others are identified from the "
    "records."
)
_CHOICE = (
    "What was measured? A rig is the mechanism with its drives and sensors, as equations; its picture is shown here. With it "
    f"the campaign begins: one text file, {CAMPAIGN}, that says which column is which signal and marks every guess."
)
# The editor has no option for what a screen reader calls it, and is loaded after the page.
_NAME_THE_FIELD = """(function name() {
  const field = document.querySelector('.cm-content');
  field ? field.setAttribute('aria-label', 'Text of the campaign') : setTimeout(name, 100);
})()"""
_UNSAVED = "Not saved yet; kept if this page is closed."
_LINE = re.compile(r"line (\d+)")


def rig_page(site: Site) -> None:
    """Choose a rig, which begins the campaign; afterwards show the rig of the campaign."""

    @ui.refreshable
    def content() -> None:
        _chosen(site) if (site.root / CAMPAIGN).is_file() else _choice(site)

    with page_of(site, "/rig", "Rig"):
        content()
        watch(lambda: ((site.root / CAMPAIGN).is_file(), _begun(site)), content.refresh)


def _chosen(site: Site) -> None:
    def aside() -> None:
        with telling():
            ui.notify(f"Moved to {set_aside(site.root, CAMPAIGN)}.")

    text("p", f"The campaign of this folder is {CAMPAIGN}. Is this its rig?")
    table = _rig_table(site.root)
    _picture(site, picture_arguments(site.root, model=table.get("model"), file=table.get("file")))
    if output := _begun(site):
        text("pre", output).props('tabindex="0" aria-label="What was written"')
    next_step(site, "/rig")
    ui.button("Move this campaign aside and begin another", on_click=aside).props("outline no-caps")


def _begun(site: Site) -> str:
    """Return what the command that began the campaign printed."""
    job = jobs.find(site.root, "init")
    return job.output if job is not None and job.exit_code == 0 else ""


def _choice(site: Site) -> None:
    from rigsight.rigs import RIGS

    options = {_GUESS: "Not sure: take the one that fits the columns best"}
    options |= {f"--model {name}": f"{name}: {rig.summary}" for name, rig in RIGS.items()}
    options |= {f"--rigs {name}": f"{name} (rig file)" for name in site.files(".toml")}
    options |= {f"--mjcf {name}": f"{name} (model of a robot)" for name in site.files(*ROBOT_SUFFIXES)}

    def arguments() -> tuple[str, ...]:
        option, _, name = str(choice.value).partition(" ")
        joints = [part for own in of_robot for part in own.arguments] if option == "--mjcf" else []
        return ("init", ".", *((option, name) if name else ()), *joints)

    def chosen() -> None:
        show_command()
        option, _, name = str(choice.value).partition(" ")
        with drawn, telling():
            drawn.clear()
            found = {"--model": {"model": name}, "--rigs": {"file": name}}.get(option)
            _picture(site, None if found is None else picture_arguments(site.root, **found))
        for own in of_robot:
            own.element.visible = option == "--mjcf"

    text("p", _CHOICE)
    text("p", "None is yours? Bring a rig file or the model of a robot on the page Files.", "hint")
    choice = ui.select(options, value=_GUESS, label="Rig").classes("wide")
    drawn = ui.element("div")
    of_robot = [typed_option(site, "init", name, label) for name, label in _OF_ROBOT]
    show_command = run_panel(site, "init", "Begin the campaign", arguments)
    choice.on_value_change(chosen)
    for own in of_robot:
        own.element.visible = False
        own.element.on_value_change(show_command)


def picture_arguments(
    root: Path, *, model: str | None = None, file: str | None = None
) -> tuple[str, ...] | None:
    """Return the arguments that draw a rig; None if its name is not known, or would be read as an option."""
    name = model
    if file is not None:
        try:
            name = tomllib.loads((root / file).read_text(encoding="utf-8")).get("name")
        except (OSError, ValueError):
            return None
    if not isinstance(name, str) or name.startswith("-"):
        return None
    return ("rigs", name, *(() if file is None else ("--rigs", file)), "--picture", picture_of(file or name))


def _picture(site: Site, arguments: Sequence[str] | None) -> None:
    """Show the picture of a rig once the command that draws it has ended."""
    if arguments is None:
        return
    file = arguments[-1]
    source = site.root / arguments[3] if "--rigs" in arguments else None

    def is_drawn() -> bool:
        picture = site.root / file
        return picture.is_file() and (source is None or source.stat().st_mtime < picture.stat().st_mtime)

    @ui.refreshable
    def image() -> None:
        job = jobs.find(site.root, _PICTURE)
        if is_drawn():
            drawn = ui.element("img").classes("rig")
            with_attributes(drawn, src=address_of(file), alt=f"Picture of the rig {arguments[1]}")
        elif job is not None and not job.is_running and job.arguments == tuple(arguments):
            for message in job.messages():
                text("p", message, "message")
        else:
            text("p", "Drawing ...").props('role="status"')

    def state() -> tuple[bool, bool]:
        job = jobs.find(site.root, _PICTURE)
        if not is_drawn() and (job is None or (not job.is_running and job.arguments != tuple(arguments))):
            with telling():
                job = jobs.start(site.root, _PICTURE, arguments)
        return is_drawn(), job is not None and job.is_running

    watch(state, image.refresh)
    image()


def _rig_table(root: Path) -> dict[str, Any]:
    try:
        table = tomllib.loads(campaign_text(root) or "").get("rig", {})
    except ValueError:
        # Not valid yet: the blanks of a begun campaign are filled in on its page.
        return {key: found[1] for key in ("model", "file")
                if (found := re.search(rf'^{key} = "([^"]+)"', campaign_text(root) or "", re.MULTILINE))}  # fmt: skip
    return table if isinstance(table, dict) else {}


async def campaign_page(site: Site) -> None:
    """Edit the text of the campaign."""
    kept = find_draft(site.root)
    saved = campaign_text(site.root) if kept is None else kept.begun_from
    shown = saved if kept is None else kept.text
    with page_of(site, "/campaign", "Campaign"):
        if shown is None:
            text("p", "This folder has no campaign yet.")
            ui.link("Begin one: the rig", "/rig").classes("next")
            return
        text("p", _WORDS)
        text("p", "Tab indents; Escape and then Tab leaves the field. Ctrl-S saves.", "hint")
        with ui.element("div").classes("command"):
            button = ui.button("Save")
            note = text("p", "" if kept is None else _UNSAVED, "note").props('role="status"')
        errors = ui.element("div").props('role="status" aria-label="Errors"')
        editor = ui.codemirror(shown, language="TOML", theme="githubLight", line_wrapping=True).classes(
            "editor"
        )
        next_step(site, "/campaign")

    def changed() -> None:
        nonlocal kept
        draft = Draft(editor.value, saved)
        with telling():
            keep_draft(site.root, draft, kept)
            kept = draft
            note.text = _UNSAVED if site.is_edited() else ""

    async def show_errors() -> None:
        found = await asyncio.to_thread(campaign_errors, site.root / CAMPAIGN)
        lines = {int(place[1]) for message in found if (place := _LINE.search(message))}
        editor.decorations = [{"kind": "line", "line": line, "class": "wrong"} for line in sorted(lines)]
        note.text = "" if found else "Saved; no error in the text."
        errors.clear()
        with errors:
            for message in found:
                _error(editor, message)

    async def save() -> None:
        nonlocal saved
        with telling():
            aside = save_campaign(site.root, Draft(editor.value, saved))
            saved = editor.value
            if aside is not None:
                words = f"{CAMPAIGN} was changed elsewhere meanwhile; that text is kept as {aside}."
                ui.notify(words, timeout=0, close_button="Close")
            await show_errors()

    editor.on_value_change(changed)
    editor.map_key("Mod-s", save)
    button.on_click(save)
    await ui.context.client.connected()
    ui.run_javascript(_NAME_THE_FIELD)
    if kept is None:
        await show_errors()


def _error(editor: ui.codemirror, message: str) -> None:
    with ui.element("div").classes("error"):
        text("p", message, "message")
        if place := _LINE.search(message):
            line = int(place[1])
            ui.button(f"Go to line {line}", on_click=lambda: editor.reveal_line(line)).props(
                "flat dense no-caps"
            )
