"""The command ``rigsight check``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import command_line, show, show_files, show_json, table
from rigsight.workflow.run.progress import listening

if TYPE_CHECKING:
    from rich.console import Group

    from rigsight.check import Check


def check(
    campaign: options.Campaign,
    out: options.ResultsFolder = Path("check"),
    effect: Annotated[
        list[str] | None,
        options.effect("Compare only this effect with the others that are named. May be repeated."),
    ] = None,
    effects: options.OwnEffects = None,
    rigs: options.OwnRigs = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
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
    from rich.console import Group
    from rich.markup import escape

    from rigsight.report.check_page import forms, headline, rivals

    findings = [(r.severity, f"{r.sentence} {r.remedy}") for r in found.remarks if r.severity != "note"]
    apart = []
    for rival in rivals(found.matrix):
        words = [rival.visible] if rival.visible else []
        words += [f"{by}: {names}" for by, names in rival.others]
        apart.append((rival.effect, rival.where, "; ".join(words)))
    alike = [f"Forms of {family} that are not told apart: {names}." for family, names in forms(found.matrix)]
    heads = ("Effect", "Where", "Not told apart from")
    effects = [table(heads, apart)] if apart else ["All families of effects can be told apart."]
    return Group(
        headline(found),
        *([table(("", "Finding"), findings)] if findings else []),
        found.identifiability,
        *([found.matrix.reason] if found.matrix.reason else [*effects, *map(escape, alike)]),
    )
