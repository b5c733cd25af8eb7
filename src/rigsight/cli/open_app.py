"""The command ``rigsight app``."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import Debug, Json
from rigsight.cli.terminal import show_as_json

HERE = "127.0.0.1"


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
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Open the campaign of a folder in a browser: from files to a diagnosis and an exported model.

    Every step is one of these commands, shown to be copied, and everything is kept in FOLDER. Only the printed address, with its
    token, opens the page. Needs the extra app.
    """
    with report_errors(debug, f"commands that were started go on, and {folder.absolute()} holds everything"):
        from rigsight.cli.application import COMMANDS
        from rigsight.errors import InputError

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
