"""The command ``rigsight vary``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import show_json
from rigsight.errors import InputError
from rigsight.workflow.run.progress import listening


def vary(
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL",
            help="A model.json, a folder that contains one, or a published set such as hysteresis_r.",
        ),
    ],
    parameter: Annotated[
        list[str],
        typer.Option(metavar="NAME", help="The parameter to vary. May be repeated; each gives one figure."),
    ],
    low: Annotated[
        float | None,
        options.optional("VALUE", "half the value in the model", "First value.", "--from"),
    ] = None,
    high: Annotated[
        float | None,
        options.optional("VALUE", "twice the value in the model", "Last value.", "--to"),
    ] = None,
    steps: Annotated[int, typer.Option(help="Number of values.")] = 5,
    amplitude: Annotated[float, typer.Option(help="Amplitude of the sweep, in the unit of the input.")] = 1.0,
    lowest: Annotated[
        float | None,
        options.optional("OMEGA", "1/12 of the natural frequency", "Lower end of the band [rad/s]."),
    ] = None,
    highest: Annotated[
        float | None,
        options.optional("OMEGA", "6 times the natural frequency", "Upper end of the band [rad/s]."),
    ] = None,
    source: Annotated[
        str | None,
        options.optional("NAME", "the first", "Input to sweep.", "--input"),
    ] = None,
    response: Annotated[
        str | None,
        options.optional("NAME", "the first", "Output whose response is shown.", "--output"),
    ] = None,
    effects: options.OwnEffects = None,
    rigs: options.OwnRigs = None,
    simulator: options.Simulators = None,
    out: options.ResultsFolder = Path("vary"),
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Show how the frequency response of a model changes with a parameter.

    Writes vary.svg, vary.png (vary_NAME.svg, ... for several parameters) and vary.json into DIR; all files or none.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.workflow.own.own_effects import own_effects
        from rigsight.workflow.own.own_rigs import own_rigs, own_simulators
        from rigsight.workflow.vary import run_vary, table_text

        own_simulators(simulator or [])
        if (lowest is None) != (highest is None):
            raise InputError("--lowest and --highest must be given together: give both, or neither.")
        band = None if lowest is None or highest is None else (lowest, highest)
        variations = run_vary(
            model,
            parameter,
            out,
            low=low,
            high=high,
            steps=steps,
            amplitude=amplitude,
            band=band,
            source=source,
            response=response,
            own_effects=own_effects(effects or [], check=False),
            own_rigs=own_rigs(rigs or []).values(),
            listener=listener,
        )
    if json:
        show_json(out / "vary.json")
    elif not quiet:
        for variation in variations:
            typer.echo(table_text(variation) + "\n")
        typer.echo(f"Figures and values: {out}")
