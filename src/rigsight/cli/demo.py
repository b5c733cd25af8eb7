"""What does ``rigsight demo`` accept, run and show?"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from rigsight.cli.exit_codes import GOES_ON, report_errors
from rigsight.cli.options import Debug, Jobs, Json, Quiet, Seed
from rigsight.cli.terminal import command_line, show, show_files, show_json
from rigsight.workflow.run.progress_display import listening


def demo(
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for campaign and results.")
    ] = Path("demo"),
    seed: Seed = 0,
    jobs: Jobs = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Run the whole chain on a virtual rig whose simulation misses an effect.

    Writes DIR/campaign (records and campaign.toml, as a measurement would leave them), diagnosis.json, model.json, report.html.
    """
    with report_errors(debug, GOES_ON), listening(quiet) as listener:
        from rigsight.workflow.demo import HIDDEN_EFFECT, run_demo

        diagnosis = run_demo(out, seed=seed, n_jobs=jobs, listener=listener, command=command_line())
    if json:
        show_json(out / "diagnosis.json")
    elif not quiet:
        from rigsight.report import summary

        show(summary(diagnosis))
        typer.echo(f"\nThe virtual rig hid {HIDDEN_EFFECT}; the diagnosis was not told.")
        show_files({"Report": out / "report.html", "Model": out / "model.json"})
        typer.echo(f"rigsight diagnose {shlex.quote(str(out / 'campaign'))} repeats it.")
