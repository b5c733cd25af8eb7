"""The command ``rigsight discover``."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import (
    Campaign,
    Debug,
    Jobs,
    Json,
    OwnEffects,
    OwnRigs,
    Quiet,
    ResultsFolder,
    Seed,
    Simulators,
)
from rigsight.cli.terminal import show, show_files, show_json
from rigsight.workflow.run.progress import listening


def discover(
    campaign: Campaign,
    out: ResultsFolder = Path("discovery"),
    one_by_one: Annotated[
        bool, typer.Option("--one-by-one", help="Also discover on each estimation record alone.")
    ] = False,
    effects: OwnEffects = None,
    rigs: OwnRigs = None,
    simulator: Simulators = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Find the equations of motion from the records, by sparse regression and free-run simulation.

    Writes discovery.json, model.json and discovery.svg into DIR; all files or none. Laws that no catalogue has are written as
    effects for --effects: discovered.py has the powers of the equation, shape.py the shape of what it lacks.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.workflow.discover import check_kept, run_discover
        from rigsight.workflow.own.own_effects import own_effects
        from rigsight.workflow.own.own_rigs import own_rigs, own_simulators

        own_simulators(simulator or [])
        check_kept(effects or [], out)
        found = run_discover(
            campaign,
            out,
            effects=own_effects(effects or [], listener=listener),
            one_by_one=one_by_one,
            own_rigs=own_rigs(rigs or []).values(),
            seed=seed,
            n_jobs=jobs,
            listener=listener,
        )
    if json:
        show_json(out / "discovery.json")
    elif not quiet:
        from rigsight.discover.result import LAWS_FILE, SHAPE_FILE
        from rigsight.report.terminal import discovery_summary

        show(discovery_summary(found))
        show_files({"Results": out / "discovery.json", "Model": out / "model.json"})
        written = {LAWS_FILE: found.own_laws, SHAPE_FILE: found.offered}
        for file in (out / name for name, law in written.items() if law):
            for command in ("discover", "diagnose"):
                typer.echo(shlex.join(["rigsight", command, str(campaign), "--effects", str(file)]))
