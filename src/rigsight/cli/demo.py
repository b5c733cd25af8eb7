"""The command ``rigsight demo``."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import GOES_ON, report_errors
from rigsight.cli.terminal import command_line, show, show_files, show_json
from rigsight.workflow.run.progress import listening


def demo(
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for campaign and results.")
    ] = Path("demo"),
    seed: options.Seed = 0,
    jobs: options.Jobs = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Make a campaign of a virtual rig with a hidden effect, and diagnose it.

    Writes DIR/campaign (records and campaign.toml, as from a measurement), DIR/diagnosis.json, DIR/model.json, DIR/report.html.
    """
    with report_errors(debug, GOES_ON), listening(quiet) as listener:
        from rigsight.workflow.demo import HIDDEN_EFFECT, run_demo

        diagnosis = run_demo(out, seed=seed, n_jobs=jobs, listener=listener, command=command_line())
    if json:
        show_json(out / "diagnosis.json")
    elif not quiet:
        from rigsight.report import summary

        show(summary(diagnosis))
        typer.echo(
            f"\nThe hidden effect of the virtual rig is {HIDDEN_EFFECT}; the diagnosis had no access to it."
        )
        show_files({"Report": out / "report.html", "Model": out / "model.json"})
        typer.echo(f"To repeat the diagnosis: rigsight diagnose {shlex.quote(str(out / 'campaign'))}")
