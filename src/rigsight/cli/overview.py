"""The commands that show what there is: ``effects``, ``rigs``, and ``app`` for the pages of a folder."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import with_groups
from rigsight.cli.terminal import show_as_json
from rigsight.errors import InputError, check_option
from rigsight.workflow.run.results import write_picture

if TYPE_CHECKING:
    from rigsight.effects import Effect

HERE = "127.0.0.1"


@with_groups
def list_effects(
    *,
    effects: options.OwnEffects = None,
    output: options.Output,
) -> None:
    """List the effects that a diagnosis tries, and check effects of your own.

    The effects of a file are simulated and fitted. If one fails a check, the reason is printed and the exit code is 2.
    """
    with output.reporting() as listener:
        from rigsight.effects import CATALOGUE
        from rigsight.workflow.own.own_effects import equation_text, own_effects

        own = own_effects(effects or [], listener=listener)
        if output.json:
            show_as_json({"effects": _listed((*CATALOGUE, *own))})
            return
        if output.quiet:
            return
        for effect in (*CATALOGUE, *own):
            typer.echo(f"{effect.name:34}{effect.place.value:18}{equation_text(effect)}")
        if own:
            typer.echo(f"\nYour own, checked: {', '.join(effect.name for effect in own)}")


def _listed(effects: Iterable[Effect]) -> list[dict[str, object]]:
    return [
        {
            "name": effect.name,
            "where": effect.place.value,
            "summary": effect.summary,
            "equations": {name: str(expression) for name, expression in effect.equations.items()},
            "states": [
                {
                    "name": str(s.symbol),
                    "rate": str(s.rate),
                    "limit": None if s.limit is None else str(s.limit),
                }
                for s in effect.states
            ],
            "parameters": [
                {
                    "name": p.name,
                    "description": p.description,
                    "dimension": p.dimension,
                    "vanishes_at": p.null,
                }
                for p in effect.parameters
            ],
        }
        for effect in effects
    ]


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


def open_app(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER",
            help="Folder of the campaign; made where it is missing.",
            show_default="the current folder",
        ),
    ] = Path(),
    host: Annotated[
        str,
        typer.Option(
            "--host",
            metavar="ADDRESS",
            help="Address of this machine to listen on. Others than 127.0.0.1 are reached from other machines, unencrypted.",
        ),
    ] = HERE,
    port: Annotated[
        int,
        typer.Option(
            "--port", metavar="NUMBER", min=0, max=65535, show_default="a free one", help="Port to listen on."
        ),
    ] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address, and open no browser.")
    ] = False,
    json: options.Json = False,
    debug: options.Debug = False,
) -> None:
    """Open the campaign of a folder in a browser: from files to a diagnosis and an exported model.

    Every step is one of these commands, shown to be copied, and everything is kept in FOLDER. Only the printed address, with its
    token, opens the page. Needs the extra app.
    """
    with report_errors(debug, f"commands that were started go on, and {folder.absolute()} holds everything"):
        from rigsight.cli.application import COMMANDS

        if find_spec("nicegui") is None or find_spec("psutil") is None:
            raise InputError(
                'The pages need the extra app, which is not installed: pip install "rigsight[app]"'
            )
        from rigsight.app.server import serve

        def announce(address: str) -> None:
            if json:
                show_as_json({"folder": str(folder), "address": address})
            else:
                typer.echo(f"{address}\nCtrl-C ends the server.")
            if not no_browser:
                typer.launch(address)

        serve(folder, COMMANDS, host=host, port=port, announce=announce)
