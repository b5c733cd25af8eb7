"""The command ``rigsight init``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import show_as_json
from rigsight.workflow.run.progress import listening

if TYPE_CHECKING:
    from rigsight.workflow.init import Draft, ModelDraft


def init(
    folder: Annotated[
        Path | None,
        typer.Argument(
            metavar="FOLDER",
            show_default="the current folder, with --mjcf",
            help="Folder of the measured files.",
        ),
    ] = None,
    model: Annotated[
        str | None,
        options.optional(
            "RIG",
            "the rig that matches the channels best, of --rigs where given",
            "Name of a rig: one that 'rigsight rigs' lists, or one declared with --rigs.",
        ),
    ] = None,
    mjcf: Annotated[
        Path | None,
        options.optional(
            "FILE",
            "none",
            "A MuJoCo model or URDF from which a rig file is written beside the campaign. Needs the extra mujoco.",
        ),
    ] = None,
    gear: Annotated[
        list[str] | None,
        options.optional(
            "JOINT=STIFFNESS",
            "rigid joints",
            "A joint with a compliant gear and its stiffness in N m/rad (N/m), so that play in the gear can be found. "
            "May be repeated.",
        ),
    ] = None,
    lock: Annotated[
        list[str] | None,
        options.optional(
            "JOINT=POSITION",
            "all joints move",
            "A joint that a brake or its controller holds, and where, in rad (m): a constant, which a record may set to "
            "another position. May be repeated.",
        ),
    ] = None,
    as_it_is: Annotated[
        bool,
        typer.Option(
            "--as-it-is",
            help="Simulate the bodies in MuJoCo, with contacts, joint ranges, equality constraints and tendons. Diagnoses take "
            "longer.",
        ),
    ] = False,
    rigs: options.OwnRigs = None,
    simulator: options.Simulators = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Write a commented campaign.toml for the measured files of a folder.

    Signals, units, kinds, amplitudes and roles are guessed; comments in the file mark each guess. An existing campaign is not
    overwritten. With --mjcf, the rig file of a robot model is written as well and checked against MuJoCo.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.errors import InputError
        from rigsight.workflow.init import run_init, run_init_from_mjcf
        from rigsight.workflow.own.own_rigs import own_simulators

        if mjcf is not None:
            named = {"--model": model, "--rigs": rigs, "--simulator": simulator}
            if others := [option for option, given in named.items() if given]:
                raise InputError(f"--mjcf already defines the rig; leave out {' and '.join(others)}.")
            folder = folder or Path()
            gears = dict(_of_joint("--gear", own, "STIFFNESS", "elbow=500") for own in gear or [])
            locked = dict(_of_joint("--lock", own, "POSITION", "elbow=0.5") for own in lock or [])
            written = run_init_from_mjcf(
                folder, mjcf, gears=gears, locked=locked, as_it_is=as_it_is, listener=listener
            )
            content, lines = _of_robot(written, folder, as_it_is)
        else:
            given = {"--gear": gear, "--lock": lock, "--as-it-is": as_it_is}
            if option := next((name for name, value in given.items() if value), None):
                raise InputError(
                    f"{option} applies only to the model of a robot; name the model with --mjcf."
                )
            if folder is None:
                raise InputError(
                    "Name the FOLDER of the measured files, or the model of a robot with --mjcf."
                )
            own_simulators(simulator or [])
            drafted = run_init(folder, model=model, rig_files=rigs or [], listener=listener)
            content, lines = _of_campaign(drafted, folder)
    if json:
        show_as_json(content)
    elif not quiet:
        for line in lines:
            typer.echo(line)


def _of_campaign(draft: Draft, folder: Path) -> tuple[dict[str, Any], list[str]]:
    """Return what was written, for JSON and in words."""
    count = len(draft.records)
    lines = [f"Written: {draft.path} ({draft.model}, {count} record{'' if count == 1 else 's'})"]
    if draft.others:
        lines.append(
            f"The rig was guessed from the channels. If it is wrong, remove the file and run init again with --model "
            f"({', '.join(draft.others)}), or with --rigs FILE --model NAME for a rig file of your own (rigsight rigs NAME "
            "prints one to start from)."
        )
    lines += [f"Not used: {name}: {reason}" for name, reason in draft.left_out]
    content = {
        "file": str(draft.path),
        "model": draft.model,
        "records": list(draft.records),
        "left_out": [{"file": name, "reason": reason} for name, reason in draft.left_out],
        "n_blanks": draft.n_blanks,
    }
    return content, [*lines, _what_is_next(draft.n_blanks, folder)]


def _what_is_next(n_blanks: int, folder: Path) -> str:
    remedy = f'Replace each "FILL IN" ({n_blanks} times) in it.' if n_blanks else "Check the comments in it."
    return f"{remedy} Then: rigsight diagnose {folder}"


def _of_robot(written: ModelDraft, folder: Path, as_it_is: bool) -> tuple[dict[str, Any], list[str]]:
    """Return what was written, for JSON and in words, and warn where the rig moves differently than MuJoCo's."""
    draft, run, campaign = written.draft, written.run, written.campaign
    count = len(draft.joints)
    lines = [f"Written: {written.path} ({count} joint{'' if count == 1 else 's'})"]
    if run.agrees:
        beside = f", without {' and '.join(run.left_out)}" if run.left_out else ""
        lines.append(
            f"A free run of {run.duration:.1f} s agrees with MuJoCo{beside}; largest relative difference {run.worst:.1g}."
        )
    else:
        why = (
            "Where bodies collide, MuJoCo's own step makes a difference."
            if as_it_is
            else f"The head of {written.path} lists what was not taken over."
        )
        typer.echo(
            f"rigsight: the free run of the rig differs from MuJoCo: the largest relative difference is {run.worst:.1g}, allowed "
            f"is {run.allowed:g}. {why}",
            err=True,
        )
    if as_it_is:
        lines.append(
            "MuJoCo computes the bodies, so a diagnosis takes several times as long as with equations. Contacts, tendons and "
            "equalities need it; a tree of joints does not."
        )
    lines += draft.notes
    if not as_it_is:
        lines.append(
            f"Gains, filter times and masses are constants. To identify one, rename its table in {written.path} from "
            "[constants.NAME] to [parameters.NAME]."
        )
    lines += [f"Not taken over: {what}" for what in draft.left_out]
    if campaign is None:
        columns = ", ".join((*draft.controls, *draft.sensors))
        lines.append(
            f"Put the measured files into {folder}, with columns t, {columns}. Then run the same command again."
        )
    else:
        lines += [f"Written: {campaign.path}", _what_is_next(campaign.n_blanks, folder)]
    content = {
        "file": str(written.path),
        "campaign": None if campaign is None else str(campaign.path),
        "left_out": list(draft.left_out),
        "notes": list(draft.notes),
        "free_run": {
            "duration_s": run.duration,
            "relative_difference": run.differences,
            "agrees": run.agrees,
        },
    }
    return content, lines


def _of_joint(option: str, text: str, number: str, example: str) -> tuple[str, float]:
    from rigsight.errors import InputError

    joint, _, value = text.rpartition("=")
    try:
        return joint, float(value)
    except ValueError:
        raise InputError(f"{option}: got '{text}'; write JOINT={number}, for instance {example}.") from None
