"""The command ``rigsight plan``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import Campaign, Debug, Json, OwnEffects, OwnRigs, Quiet, ResultsFolder, Seed
from rigsight.cli.terminal import show, show_files, show_json
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
    records. Writes plan.csv to be played, plan.json, plan.svg and plan.png into DIR.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.workflow.own.own_effects import own_effects
        from rigsight.workflow.own.own_rigs import own_rigs
        from rigsight.workflow.plan import PLAN_FILE, PLAN_PICTURES, PLAN_RECORD, run_plan

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
        )
    if json:
        show_json(out / PLAN_FILE)
    elif not quiet:
        show(_summary(found))
        show_files({"Play": out / PLAN_RECORD, "Picture": out / PLAN_PICTURES[0], "Results": out / PLAN_FILE})


def _summary(found: Plan) -> Group:
    from rich import box
    from rich.console import Group
    from rich.markup import escape
    from rich.table import Table

    rivals = Table("Rival", "Probability now", "Residual when fitted again", box=box.SIMPLE)
    for one in found.rivals:
        rivals.add_row(escape(one.effects), f"{one.probability:.2f}", f"{one.rms_left:.3g} errors")
    limits = Table("Signal", "Limit", "Largest predicted", box=box.SIMPLE)
    for limit, largest in found.limits:
        limits.add_row(escape(limit.name), f"{limit.value:g}", f"{largest:.3g}")
    constants = ", ".join(f"{name} = {value:g}" for name, value in found.record.constants.items())
    trials = found.trials
    return Group(
        f"Play: {escape(found.what)}, {found.record.duration:g} s{f', with {constants}' if constants else ''}.",
        rivals,
        limits,
        f"Expected probability of the cause afterwards: {found.promised:.2f}, now {found.now:.2f}. "
        f"In {trials.n} simulated outcomes the cause was the most probable in {trials.right:.0%}, "
        f"decided in {trials.decided:.0%}, wrongly in {trials.wrong:.0%}.",
    )
