"""The pages on results: run a command on the campaign and read its page, and export the model."""

from __future__ import annotations

import json
from functools import partial

from nicegui import ui

from rigsight.app.page_parts import (
    downloads,
    next_step,
    own_effects_option,
    page_of,
    run_panel,
    shown_page,
    text,
    typed_option,
    watch,
)
from rigsight.app.steps import EXPORTS, RESULTS, ROBOT_SUFFIXES, SHOWN, Run, Site
from rigsight.app.workspace import CAMPAIGN
from rigsight.workflow.campaign.model_file import MODEL_FILE


def result_page(site: Site, step: Run) -> None:
    """Run one command on the campaign, and show what it found."""
    is_page = step.page.endswith(SHOWN)

    @ui.refreshable
    def results() -> None:
        if is_page:
            shown_page(site, f"{step.out}/{step.page}", step.title)
        downloads(site.results(step.out))

    with page_of(site, f"/{step.key}", step.title):
        text("p", step.words)
        if not (site.root / CAMPAIGN).is_file():
            text("p", "This folder has no campaign yet.")
            ui.link("Begin one: the rig", "/rig").classes("next")
            return
        options = [typed_option(site, step.key, name, label) for name, label in step.fields]
        if own := own_effects_option(site, step.key):
            options.append(own)

        def arguments() -> tuple[str, ...]:
            return site.arguments(step, [part for option in options for part in option.arguments])

        show_command = run_panel(site, step.key, "Run", arguments, results.refresh, is_open=not is_page)
        for option in options:
            option.element.on_value_change(show_command)
        results()
        next_step(site, f"/{step.key}")


def export_page(site: Site) -> None:
    """Write the diagnosed model for other tools."""
    from rigsight.export.targets import TARGETS
    from rigsight.workflow.export import ROBOT_TARGETS

    suffixes = {target.name: target.suffix for target in TARGETS.values()}
    words = {target.name: f"{target.name}: {target.summary}" for target in TARGETS.values()}
    robots = site.files(*ROBOT_SUFFIXES)
    if robots:
        suffixes |= ROBOT_TARGETS
        words |= {name: f"{name}: back into the model of the robot" for name in ROBOT_TARGETS}

    @ui.refreshable
    def exported() -> None:
        downloads(site.results(EXPORTS))

    with page_of(site, "/export", "Export"):
        try:
            name = json.loads((site.root / RESULTS / MODEL_FILE).read_text(encoding="utf-8"))["rig"]
        except (OSError, ValueError, KeyError):
            text("p", "There is no model yet: it comes with the diagnosis.")
            ui.link("The diagnosis", "/diagnosis").classes("next")
            return
        text("p", "The diagnosed model as code that runs without rigsight.")
        choice = ui.select(words, value=next(iter(words)), label="Target").classes("wide")

        def arguments() -> tuple[str, ...]:
            target = str(choice.value)
            out = f"{EXPORTS}/{target}/{name}{suffixes[target]}"
            robot = ("--mjcf", robots[0]) if target in ROBOT_TARGETS else ()
            return ("export", RESULTS, "--to", target, "--out", out, *robot)

        choice.on_value_change(run_panel(site, "export", "Export", arguments))
        exported()
        watch(partial(site.results, EXPORTS), exported.refresh)
