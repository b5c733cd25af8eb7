"""The command ``rigsight compare``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import command_line, show, show_files, show_json
from rigsight.workflow.run.progress import listening


def compare(
    campaign: options.Campaign,
    model: Annotated[
        list[str],
        typer.Argument(
            metavar="MODEL...",
            help="Each a model.json, a folder that contains one, a published set such as hysteresis_r, or given for the "
            "simulation that the campaign gives. NAME=MODEL gives it a name in the results.",
        ),
    ],
    out: options.ResultsFolder = Path("comparison"),
    method: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Estimator of the frequency responses: local_rational, local_polynomial, h1 or thesis.",
        ),
    ] = "local_rational",
    step_seconds: Annotated[
        float, typer.Option(metavar="SECONDS", help="Time after a step over which it is compared.")
    ] = 4.0,
    effects: options.OwnEffects = None,
    rigs: options.OwnRigs = None,
    simulator: options.Simulators = None,
    jobs: options.Jobs = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Score models on all records: frequency responses, steps and free runs, each with its noise floor.

    Writes comparison.json, comparison.csv, comparison.html and figures into DIR; all files or none.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.workflow.compare import run_compare
        from rigsight.workflow.own.own_effects import own_effects
        from rigsight.workflow.own.own_rigs import own_rigs, own_simulators

        own_simulators(simulator or [])
        comparison = run_compare(
            campaign,
            model,
            out,
            method=method,
            step_seconds=step_seconds,
            own_effects=own_effects(effects or [], check=False),
            own_rigs=list(own_rigs(rigs or []).values()),
            n_jobs=jobs,
            listener=listener,
            command=command_line(),
        )
    if json:
        show_json(out / "comparison.json")
    elif not quiet:
        from rigsight.report import comparison_summary

        show(comparison_summary(comparison))
        show_files({"Page": out / "comparison.html", "Table": out / "comparison.csv"})
