"""What does ``rigsight rigs`` accept, run and show?"""

from __future__ import annotations

from typing import Annotated

import typer

from rigsight.cli.exit_codes import told
from rigsight.cli.options import Debug, Json
from rigsight.cli.terminal import show_as_json


def list_rigs(
    name: Annotated[
        str | None, typer.Argument(help="Print this rig's file, to copy and change.", show_default="list all")
    ] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """List the rigs that come with rigsight, or print the file of one."""
    with told(debug):
        from rigsight.errors import check_option
        from rigsight.rigs import RIGS, rig_file_text

        if name is not None:
            text = rig_file_text(check_option("Rig", name, RIGS))
            if json:
                show_as_json({"name": name, "file": text})
            else:
                typer.echo(text, nl=False)
            return
        if json:
            show_as_json({"rigs": [{"name": rig.name, "summary": rig.summary} for rig in RIGS.values()]})
            return
        for rig in RIGS.values():
            typer.echo(f"{rig.name:16}{rig.summary}")
