"""What does ``rigsight init`` accept, run and show?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import Debug, Json, OwnRigs, Quiet, Simulators
from rigsight.cli.terminal import show_as_json
from rigsight.workflow.run.progress_display import listening


def init(
    folder: Annotated[
        Path | None,
        typer.Argument(
            metavar="FOLDER",
            show_default="this folder, with --mjcf",
            help="The folder that holds the measured files.",
        ),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            "--model",
            metavar="RIG",
            show_default="the one that the channels fit best",
            help="A rig that rigsight rigs lists, or one of --rigs.",
        ),
    ] = None,
    mjcf: Annotated[
        Path | None,
        typer.Option(
            "--mjcf",
            metavar="FILE",
            show_default="(no model)",
            help="A MuJoCo model or URDF to write a rig file from, beside the campaign. Needs the extra mujoco.",
        ),
    ] = None,
    gear: Annotated[
        list[str] | None,
        typer.Option(
            "--gear",
            metavar="JOINT=STIFFNESS",
            show_default="(joints move their bodies rigidly)",
            help="A joint of the model whose gear gives way, in N m/rad (N/m): play at it can be found then. May be repeated.",
        ),
    ] = None,
    as_it_is: Annotated[
        bool,
        typer.Option(
            "--as-it-is",
            help="Leave the model's bodies to MuJoCo: contacts, ranges, equalities and tendons too. Diagnoses take longer.",
        ),
    ] = False,
    rigs: OwnRigs = None,
    simulator: Simulators = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write a commented campaign.toml for the measured files of a folder.

    Guesses signals, units, kinds, amplitudes and roles, and says so in comments; a campaign that exists is not overwritten. With
    --mjcf, writes the rig file of a robot's model as well, and checks it against MuJoCo.
    """
    if mjcf is not None:
        _init_from_mjcf(
            folder or Path(), mjcf, gear, model, rigs, as_it_is=as_it_is, json=json, quiet=quiet, debug=debug
        )
        return
    with report_errors(debug):
        from rigsight.errors import InputError

        if gear or as_it_is:
            option = "--gear is of a joint" if gear else "--as-it-is is"
            raise InputError(f"{option} of a robot's model; name the model with --mjcf.")
        if folder is None:
            raise InputError("Name the FOLDER that holds the measured files, or a model with --mjcf.")
        from rigsight.workflow.init import run_init
        from rigsight.workflow.own.own_simulators import own_simulators

        own_simulators(simulator or [])
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


def _init_from_mjcf(
    folder: Path,
    file: Path,
    gears: list[str] | None,
    model: str | None,
    rigs: list[Path] | None,
    *,
    as_it_is: bool,
    json: bool,
    quiet: bool,
    debug: bool,
) -> None:
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.errors import InputError
        from rigsight.workflow.init import run_init_from_mjcf

        if model is not None or rigs:
            raise InputError("--mjcf gives the rig; leave out --model and --rigs.")
        written = run_init_from_mjcf(
            folder, file, gears=dict(map(_gear, gears or [])), as_it_is=as_it_is, listener=listener
        )
    draft, run = written.draft, written.run
    if not run.agrees:
        typer.echo(
            f"rigsight: the rig does not move as MuJoCo does: the largest relative difference is {run.worst:.1g}, allowed is "
            f"{run.allowed:g}. See what was not taken over, at the head of {written.path}.",
            err=True,
        )
    if json:
        show_as_json(
            {
                "file": str(written.path),
                "campaign": None if written.campaign is None else str(written.campaign.path),
                "left_out": list(draft.left_out),
                "notes": list(draft.notes),
                "free_run": {
                    "duration_s": run.duration,
                    "relative_difference": run.differences,
                    "agrees": run.agrees,
                },
            }
        )
        return
    if quiet:
        return
    count = len(draft.joints)
    typer.echo(f"Written: {written.path} ({count} joint{'' if count == 1 else 's'})")
    beside = f", without {' and '.join(run.left_out)}" if run.left_out else ""
    if run.agrees:
        typer.echo(
            f"Free run of {run.duration:.1f} s beside MuJoCo{beside}: it moves as MuJoCo does, largest relative difference "
            f"{run.worst:.1g}."
        )
    for note in draft.notes:
        typer.echo(note)
    for what in draft.left_out:
        typer.echo(f"Not taken over: {what}")
    if written.campaign is None:
        typer.echo(
            f"Put records into {folder}, with columns t, {', '.join((*draft.controls, *draft.sensors))}. "
            "Then the same command again."
        )
    else:
        typer.echo(
            f"Written: {written.campaign.path}. Check the comments in it. Then: rigsight diagnose {folder}"
        )


def _gear(text: str) -> tuple[str, float]:
    from rigsight.errors import InputError

    joint, _, stiffness = text.rpartition("=")
    try:
        return joint, float(stiffness)
    except ValueError:
        raise InputError(f"--gear: JOINT=STIFFNESS, such as elbow=500, got '{text}'.") from None
