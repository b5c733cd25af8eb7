"""What does ``rigsight init`` accept, run and show?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigsight.cli.exit_codes import told
from rigsight.cli.options import Debug, Json, OwnRigs, Quiet
from rigsight.cli.terminal import show_as_json


def init(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="The folder that holds the measured files.")
    ],
    model: Annotated[
        str | None,
        typer.Option(
            "--model",
            metavar="RIG",
            show_default="the one that the channels fit best",
            help="A rig that rigsight rigs lists, or one of --rigs.",
        ),
    ] = None,
    rigs: OwnRigs = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write a commented campaign.toml for the measured files of a folder.

    Guesses signals, units, kinds, amplitudes and roles, and says so in comments; a campaign that exists is not overwritten.
    """
    with told(debug):
        from rigsight.workflow.campaigns.init import run_init

        draft = run_init(folder, model=model, rig_files=rigs or [])
    if json:
        show_as_json(
            {
                "file": str(draft.path),
                "model": draft.model,
                "records": list(draft.records),
                "left_out": [{"file": name, "reason": reason} for name, reason in draft.left_out],
                "n_blanks": draft.n_blanks,
            }
        )
        return
    if quiet:
        return
    count = len(draft.records)
    typer.echo(f"Written: {draft.path} ({draft.model}, {count} record{'' if count == 1 else 's'})")
    if model is None:
        typer.echo(
            f"The rig is a guess from the channels; remove the file and say --model for another ({', '.join(draft.others)}), or "
            "--rigs FILE --model NAME for a rig file of your own (rigsight rigs NAME prints one to begin with)."
        )
    for name, reason in draft.left_out:
        typer.echo(f"Not used: {name}: {reason}")
    if draft.n_blanks:
        typer.echo(f'Fill in what reads "FILL IN" ({draft.n_blanks} times). Then: rigsight diagnose {folder}')
    else:
        typer.echo(f"Check the comments in it. Then: rigsight diagnose {folder}")
