"""The command ``rigsight rigs``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import show_as_json
from rigsight.errors import InputError, check_option
from rigsight.workflow.run.results import write_picture


def list_rigs(
    name: Annotated[
        str | None,
        typer.Argument(help="Print the file of this rig, as a template.", show_default="list all"),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the rig NAME into a PNG or SVG file instead."),
    ] = None,
    rigs: options.OwnRigs = None,
    simulator: options.Simulators = None,
    json: options.Json = False,
    debug: options.Debug = False,
) -> None:
    """List the built-in rigs, check rig files of your own, print the file of a rig, or draw it.

    If a file of --rigs cannot be used, the error and its place in the file are printed and the exit code is 2.
    """
    with report_errors(debug):
        from rigsight.plot import encoded, rig_picture
        from rigsight.rigs import rig_file_text
        from rigsight.workflow.own.own_rigs import known_rigs, own_rigs, own_simulators

        own_simulators(simulator or [])
        files = own_rigs(rigs or [])
        known = known_rigs(files.values())
        if picture is not None:
            if name is None:
                raise InputError(
                    "--picture needs the name of the rig to draw: rigsight rigs NAME --picture FILE.png."
                )
            rig = known[check_option("Rig", name, known)]
            written = str(write_picture(picture, lambda suffix: encoded(rig_picture(rig), suffix, rig.name)))
            show_as_json({"name": name, "picture": written}) if json else typer.echo(written)
            return
        if name is not None:
            own = {rig.name: file for file, rig in files.items()}
            check_option("Rig", name, known)
            text = own[name].read_text("utf-8") if name in own else rig_file_text(name)
            if json:
                show_as_json({"name": name, "file": text})
            else:
                typer.echo(text, nl=False)
            return
        if json:
            listed = [
                {
                    "name": rig.name,
                    "summary": rig.summary,
                    "inputs": [signal.name for signal in rig.inputs],
                    "outputs": [signal.name for signal in rig.outputs],
                }
                for rig in known.values()
            ]
            show_as_json({"rigs": listed})
            return
        width = max(map(len, known)) + 2
        for rig in known.values():
            typer.echo(f"{rig.name:{width}}{rig.summary}")
        if files:
            typer.echo(f"\nYour own, checked: {', '.join(rig.name for rig in files.values())}")
