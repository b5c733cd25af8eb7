"""The commands around a diagnosis: ``demo``, ``diagnose``, ``reproduce``, ``power`` and ``plan``."""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import GOES_ON, report_errors
from rigsight.cli.options import with_groups
from rigsight.cli.terminal import command_line, show, show_files, show_json, table
from rigsight.errors import InputError

if TYPE_CHECKING:
    from rich.console import Group

    from rigsight.plan.planning import Plan
    from rigsight.workflow.power import Power
    from rigsight.workflow.reproduce import Reproduction

NOT_THE_SAME = 1


@with_groups
def demo(
    *,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for campaign and results.")
    ] = Path("demo"),
    seed: options.Seed = 0,
    jobs: options.Jobs = None,
    output: options.Output,
) -> None:
    """Make a campaign of a virtual rig with a hidden effect, and diagnose it.

    Writes DIR/campaign (records and campaign.toml, as from a measurement), DIR/diagnosis.json, DIR/model.json, DIR/report.html.
    """
    with output.reporting(GOES_ON) as listener:
        from rigsight.workflow.demo import HIDDEN_EFFECT, run_demo

        diagnosis = run_demo(out, seed=seed, n_jobs=jobs, listener=listener, command=command_line())
    if output.json:
        show_json(out / "diagnosis.json")
    elif not output.quiet:
        from rigsight.report.terminal import summary

        show(summary(diagnosis))
        typer.echo(
            f"\nThe hidden effect of the virtual rig is {HIDDEN_EFFECT}; the diagnosis had no access to it."
        )
        show_files({"Report": out / "report.html", "Model": out / "model.json"})
        typer.echo(f"To repeat the diagnosis: rigsight diagnose {shlex.quote(str(out / 'campaign'))}")


@with_groups
def diagnose(
    *,
    campaign: options.Campaign,
    out: options.ResultsFolder = Path("diagnosis"),
    effect: Annotated[list[str] | None, options.effect("Try only this effect. May be repeated.")] = None,
    own: options.Own,
    by: Annotated[
        str,
        options.optional("NAME", "nobody", "Who made it, for the foot of the report."),
    ] = "",
    seed: options.Seed = 0,
    jobs: options.Jobs = None,
    output: options.Output,
) -> None:
    """Find which effect is missing in a simulation, where it acts, and how far it closes the gap.

    Begins with the check of the records. Writes diagnosis.json, model.json, report.html, check.json and check.html into DIR; all
    files or none.
    """
    with output.reporting(GOES_ON) as listener:
        from rigsight.report.terminal import summary
        from rigsight.workflow.diagnose import run_diagnose

        read, command = own.named(effect, listener), command_line()
        diagnosis = run_diagnose(
            campaign, out, **read, seed=seed, n_jobs=jobs, listener=listener, command=command, by=by
        )
    files = {"Report": out / "report.html", "Model": out / "model.json"}
    output.show(out / "diagnosis.json", lambda: summary(diagnosis), files)


@with_groups
def reproduce(
    *,
    report: Annotated[Path, typer.Argument(metavar="REPORT", help="The report.html of a diagnosis.")],
    out: options.ResultsFolder = Path("reproduction"),
    output: options.Output,
) -> None:
    """Run the diagnosis of a report again and say whether it says the same; exit code 1 where it does not.

    Writes the new results and reproduction.json into DIR.
    """
    with report_errors(output.debug):
        from rigsight.workflow.reproduce import REPRODUCTION_FILE, run_reproduce

        def run(arguments: Sequence[str], folder: Path) -> None:
            if not folder.is_dir():
                raise InputError(f"{folder}, the folder in which the report was made, does not exist.")
            done = subprocess.run(
                [sys.executable, "-m", "rigsight", *arguments, "--quiet"], cwd=folder, check=False
            )
            if done.returncode:
                raise InputError("The diagnosis of the report could not be repeated; the message is above.")

        found = run_reproduce(report, out, run)
    file = out / REPRODUCTION_FILE
    output.show(file, lambda: _reproduction_summary(found), {"Results": file})
    if not found.is_same:
        raise typer.Exit(NOT_THE_SAME)


def _reproduction_summary(found: Reproduction) -> Group:
    from rich.console import Group

    if found.changed_inputs:
        words = (
            f"Not run: these inputs are missing or changed in {found.folder}: {', '.join(found.changed_inputs)}. Keep a report "
            "in its place beside its campaign."
        )
    elif found.differences:
        words = "The same inputs give other results."
    else:
        words = "The same inputs give the same results."
    if found.page_is_as_written is False:
        words += " The page of the report was changed after it was written: do not trust what it prints."
    rows = [(f"version of {name}", *pair) for name, pair in found.versions.items()]
    rows += [(one.key, f"{one.reported}", f"{one.found}") for one in found.differences]
    return Group(words, *([table(("", "Report", "Now"), rows)] if rows else []))


@with_groups
def power(
    *,
    campaign: options.Campaign,
    out: options.ResultsFolder = Path("power"),
    effect: Annotated[list[str] | None, options.effect("Ask only for this effect. May be repeated.")] = None,
    own: options.OwnParts,
    seed: options.Seed = 0,
    output: options.Output,
) -> None:
    """Show the smallest size of each effect that these records would have named, before you trust that nothing is missing.

    Writes power.json into DIR.
    """
    with output.reporting() as listener:
        from rigsight.workflow.power import run_power

        found = run_power(campaign, out, **own.named(effect, listener), seed=seed, listener=listener)
    file = out / "power.json"
    output.show(file, lambda: _sizes_table(found), {"Sizes": file})


def _sizes_table(found: Power) -> Group:
    from rich.console import Group

    from rigsight.report.labels import effect_label, listed
    from rigsight.units import behind

    rows, without = [], dict[str, list[str]]()
    for size in found.sizes:
        values = [f"{name} = {value:.3g}{behind(unit)}" for name, (value, unit) in size.parameters.items()]
        if values:
            beside = f" (with {', '.join(values[1:])})" if values[1:] else ""
            rows.append((effect_label(size.effect), size.where, values[0] + beside))
        else:
            without.setdefault(size.reason, []).append(f"{effect_label(size.effect)} at {size.where}")
    reasons = [(listed(effects), reason) for reason, effects in without.items()]
    named = [table(("Effect", "Where", "Named from"), rows)] if rows else []
    return Group(*named, *([table(("Effects without a size", "Why"), reasons)] if reasons else []))


@with_groups
def plan(
    *,
    campaign: options.Campaign,
    out: options.ResultsFolder = Path("plan"),
    diagnosis: Annotated[
        Path | None,
        options.optional("DIR", "none", "Results of 'rigsight diagnose': they name the rivals."),
    ] = None,
    rivals: Annotated[
        str | None,
        options.optional(
            "NAME,NAME",
            "those of the diagnosis, else what 'rigsight check' leaves open",
            "Effects to be told apart, A+B for two at once.",
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        options.optional(
            "NAME=VALUE",
            "inputs as large as in the records",
            "Largest absolute value of an input or a sensor, or of its rate: x=0.02, d(x)=0.5, u=3. Of a constant, such "
            "as a payload, a value that it may have: m=2. May be repeated.",
        ),
    ] = None,
    seconds: Annotated[float, typer.Option(help="Duration of the experiment.")] = 20.0,
    own: options.OwnParts,
    seed: options.Seed = 0,
    output: options.Output,
) -> None:
    """Plan the experiment that separates rivals, and say what probability to expect afterwards.

    Without a verdict it is planned for effects that 'rigsight check' leaves open. CAMPAIGN may be a rig file, before there are
    records. Writes plan.csv to be played, plan.html, plan.json, plan.svg and plan.png into DIR.
    """
    with output.reporting() as listener:
        from rigsight.workflow.plan import PLAN_FILE, PLAN_PAGE, PLAN_RECORD, run_plan

        found = run_plan(
            campaign,
            out,
            limits=limit or [],
            seconds=seconds,
            diagnosis=diagnosis,
            rivals=rivals,
            **own.read(listener),
            seed=seed,
            listener=listener,
            command=command_line(),
        )
    files = {"Play": out / PLAN_RECORD, "Page": out / PLAN_PAGE, "Results": out / PLAN_FILE}
    output.show(out / PLAN_FILE, lambda: _plan_summary(found), files)


def _plan_summary(found: Plan) -> Group:
    from rich.console import Group
    from rich.markup import escape

    from rigsight.report.plan import plan_headline, promise

    rivals = [(one.effects, f"{one.probability:.2f}", f"{one.rms_left:.2f} errors") for one in found.rivals]
    limits = [(limit.name, f"{limit.value:g}", f"{largest:.3g}") for limit, largest in found.limits]
    return Group(
        escape(plan_headline(found)),
        table(("Rival", "Probability now", "Residual when fitted again"), rivals),
        table(("Signal", "Limit", "Largest predicted"), limits),
        promise(found),
    )
