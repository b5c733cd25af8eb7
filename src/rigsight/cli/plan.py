"""The command ``rigsight plan``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import Campaign, Debug, Json, OwnEffects, OwnRigs, Quiet, ResultsFolder, Seed
from rigsight.cli.terminal import command_line, show, show_files, show_json
from rigsight.workflow.run.progress import listening

if TYPE_CHECKING:
    from rich.console import Group

    from rigsight.plan import Plan


def plan(
    campaign: Campaign,
    out: ResultsFolder = Path("plan"),
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", show_default="none", help="Results of 'rigsight diagnose': they name the rivals."
        ),
    ] = None,
    rivals: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME",
            show_default="those of the diagnosis, else what 'rigsight check' leaves open",
            help="Effects to be told apart, A+B for two at once.",
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            show_default="inputs as large as in the records",
            help="Largest absolute value of an input or a sensor, or of its rate: x=0.02, d(x)=0.5, u=3. Of a constant, such "
            "as a payload, a value that it may have: m=2. May be repeated.",
        ),
    ] = None,
    seconds: Annotated[float, typer.Option(help="Duration of the experiment.")] = 20.0,
    effects: OwnEffects = None,
    rigs: OwnRigs = None,
    seed: Seed = 0,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Plan the experiment that separates rivals, and say what probability to expect afterwards.

    Without a verdict it is planned for effects that 'rigsight check' leaves open. CAMPAIGN may be a rig file, before there are
    records. Writes plan.csv to be played, plan.html, plan.json, plan.svg and plan.png into DIR.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.workflow.own.own_effects import own_effects
        from rigsight.workflow.own.own_rigs import own_rigs
        from rigsight.workflow.plan import PLAN_FILE, PLAN_PAGE, PLAN_RECORD, run_plan

        found = run_plan(
            campaign,
            out,
            limits=limit or [],
            seconds=seconds,
            diagnosis=diagnosis,
            rivals=rivals,
            own_effects=own_effects(effects or [], listener=listener),
            own_rigs=own_rigs(rigs or []).values(),
            seed=seed,
            listener=listener,
            command=command_line(),
        )
    if json:
        show_json(out / PLAN_FILE)
    elif not quiet:
        show(_summary(found))
        show_files({"Play": out / PLAN_RECORD, "Page": out / PLAN_PAGE, "Results": out / PLAN_FILE})


def _summary(found: Plan) -> Group:
    from rich import box
    from rich.console import Group
    from rich.markup import escape
    from rich.table import Table

    from rigsight.report.plan_page import headline, promise

    rivals = Table("Rival", "Probability now", "Residual when fitted again", box=box.SIMPLE)
    for one in found.rivals:
        rivals.add_row(escape(one.effects), f"{one.probability:.2f}", f"{one.rms_left:.3g} errors")
    limits = Table("Signal", "Limit", "Largest predicted", box=box.SIMPLE)
    for limit, largest in found.limits:
        limits.add_row(escape(limit.name), f"{limit.value:g}", f"{largest:.3g}")
    return Group(escape(headline(found)), rivals, limits, promise(found))
