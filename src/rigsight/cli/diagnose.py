"""The command ``rigsight diagnose``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from rigsight.cli import options
from rigsight.cli.exit_codes import GOES_ON, report_errors
from rigsight.cli.terminal import command_line, show, show_files, show_json
from rigsight.workflow.run.progress import listening


def diagnose(
    campaign: options.Campaign,
    out: options.ResultsFolder = Path("diagnosis"),
    effect: Annotated[list[str] | None, options.effect("Try only this effect. May be repeated.")] = None,
    effects: options.OwnEffects = None,
    rigs: options.OwnRigs = None,
    simulator: options.Simulators = None,
    by: Annotated[
        str,
        options.optional("NAME", "nobody", "Who made it, for the foot of the report."),
    ] = "",
    seed: options.Seed = 0,
    jobs: options.Jobs = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Find which effect is missing in a simulation, where it acts, and how far it closes the gap.

    Begins with the check of the records. Writes diagnosis.json, model.json, report.html, check.json and check.html into DIR; all
    files or none.
    """
    with report_errors(debug, GOES_ON), listening(quiet) as listener:
        from rigsight.workflow.diagnose import run_diagnose
        from rigsight.workflow.own.own_effects import named, own_effects
        from rigsight.workflow.own.own_rigs import own_rigs, own_simulators

        own_simulators(simulator or [])
        own = own_effects(effects or [], listener=listener)
        diagnosis = run_diagnose(
            campaign,
            out,
            effects=named(effect or [], own),
            own_effects=own,
            own_rigs=own_rigs(rigs or []).values(),
            seed=seed,
            n_jobs=jobs,
            listener=listener,
            command=command_line(),
            by=by,
        )
    if json:
        show_json(out / "diagnosis.json")
    elif not quiet:
        from rigsight.report import summary

        show(summary(diagnosis))
        show_files({"Report": out / "report.html", "Model": out / "model.json"})
