"""The command ``rigsight identify``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import command_line, show, show_files, show_json
from rigsight.workflow.run.progress import listening


def identify(
    campaign: options.Campaign,
    out: options.ResultsFolder = Path("identification"),
    method: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Estimator of the frequency responses: local_rational or local_polynomial; for built-in rigs of one motion also "
            "h1 or thesis.",
        ),
    ] = "local_rational",
    resolution: Annotated[
        float | None,
        options.optional(
            "RAD_S",
            "chosen for each record",
            "Frequency resolution: width of the local bands, or spacing of the averaged frequencies.",
        ),
    ] = None,
    objective: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="What fits over time minimize: windows, the error with fitted initial states, over windows if the rig drifts; "
            "or free-run, the error of each whole record, from the state that its first samples give.",
        ),
    ] = "windows",
    initial_samples: Annotated[
        int | None,
        options.optional("N", "20", "Number of first samples that give the initial state of a free run."),
    ] = None,
    effect: Annotated[
        list[str] | None,
        options.effect(
            "Calibrate the rig with this effect as well; one with memory, such as bouc_wen_hysteresis. May be repeated.",
            "the rig's own equations",
        ),
    ] = None,
    effects: options.OwnEffects = None,
    rigs: options.OwnRigs = None,
    simulator: options.Simulators = None,
    seed: options.Seed = 0,
    jobs: options.Jobs = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Identify the parameters of the rig from frequency responses and steps, for each record and for all together.

    Writes identification.json, model.json, amplitudes.svg, plots of the responses (for rigs of one motion a Bode plot for each
    record) and identification.html with the responses of every sensor to every input, the poles, and which parameters the records
    determine into DIR; all files or none. With --effect, model.json holds the rig with these effects.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.workflow.identify import run_identify
        from rigsight.workflow.own.own_effects import named, own_effects
        from rigsight.workflow.own.own_rigs import own_rigs, own_simulators

        own_simulators(simulator or [])
        # Effects of installed packages are checked only where some may be named.
        own = own_effects(effects or [], listener=listener) if effect or effects else ()
        identification = run_identify(
            campaign,
            out,
            method=method,
            resolution=resolution,
            objective=objective,
            initial_samples=initial_samples,
            effects=named(effect, own) if effect else (),
            own_effects=own,
            own_rigs=own_rigs(rigs or []).values(),
            seed=seed,
            n_jobs=jobs,
            listener=listener,
            command=command_line(),
        )
    if json:
        show_json(out / "identification.json")
    elif not quiet:
        from rigsight.report import identification_summary

        show(identification_summary(identification))
        page = {} if identification.identifiability is None else {"Page": out / "identification.html"}
        show_files({**page, "Results": out / "identification.json", "Model": out / "model.json"})
