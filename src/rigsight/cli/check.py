"""The command ``rigsight check``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import (
    Campaign,
    Debug,
    Json,
    OwnEffects,
    OwnRigs,
    Quiet,
    ResultsFolder,
    effect_names,
)
from rigsight.cli.terminal import command_line, show, show_files, show_json
from rigsight.workflow.run.progress import listening

if TYPE_CHECKING:
    from rich.console import Group

    from rigsight.check import Check


def check(
    campaign: Campaign,
    out: ResultsFolder = Path("check"),
    effect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            show_default="the catalogue and your own",
            help="Compare only this effect with the others that are named. May be repeated.",
            autocompletion=effect_names,
        ),
    ] = None,
    effects: OwnEffects = None,
    rigs: OwnRigs = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Say in seconds what the records can show: their faults, the parameters they determine, the effects they tell apart.

    CAMPAIGN may be a rig file: then a simulated sweep takes the place of records. Writes check.json and check.html into DIR.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.workflow.check import CHECK_FILE, CHECK_PAGE, run_check
        from rigsight.workflow.own.own_effects import named, own_effects
        from rigsight.workflow.own.own_rigs import own_rigs

        own = own_effects(effects or [], listener=listener)
        found = run_check(
            campaign,
            out,
            effects=named(effect or [], own),
            own_effects=own,
            own_rigs=own_rigs(rigs or []).values(),
            listener=listener,
            command=command_line(),
        )
    if json:
        show_json(out / CHECK_FILE)
    elif not quiet:
        show(_summary(found))
        show_files({"Page": out / CHECK_PAGE, "Results": out / CHECK_FILE})


def _summary(found: Check) -> Group:
    from rich import box
    from rich.console import Group
    from rich.markup import escape
    from rich.table import Table

    from rigsight.report.check_page import forms, headline, rivals

    findings = Table("", "Finding", box=box.SIMPLE)
    for remark in found.remarks:
        if remark.severity != "note":
            findings.add_row(remark.severity, escape(f"{remark.sentence} {remark.remedy}"))
    apart = Table("Effect", "Where", "Not told apart from", box=box.SIMPLE)
    for rival in rivals(found.matrix):
        words = [rival.visible] if rival.visible else []
        words += [f"{by}: {names}" for by, names in rival.others]
        apart.add_row(rival.effect, escape(rival.where), escape("; ".join(words)))
    alike = [f"Forms of {family} that are not told apart: {names}." for family, names in forms(found.matrix)]
    faults = [findings] if findings.row_count else []
    effects = [apart] if apart.row_count else ["All families of effects can be told apart."]
    return Group(
        headline(found),
        *faults,
        found.identifiability,
        *([found.matrix.reason] if found.matrix.reason else [*effects, *map(escape, alike)]),
    )
