"""The commands on measured files and records, before any fit: ``inspect``, ``init`` and ``check``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import with_groups
from rigsight.cli.terminal import command_line, show, show_as_json, table
from rigsight.errors import InputError

if TYPE_CHECKING:
    from rich.console import Group
    from rich.table import Table

    from rigsight.check import Check
    from rigsight.workflow.init import Draft, ModelDraft
    from rigsight.workflow.inspect import ChannelSummary, Inspection

_NAME_WIDTH = 16
"""Of the columns of names, at least, where they are as long."""
_MOST_ROWS = 12
"""Of the table of effects: that of a rig with several joints would be longer than a screen, and the page has it."""


@with_groups
def inspect(
    *,
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A measured file: CSV, MATLAB, HDF5, MDF4, TDMS, Parquet, UFF, JSON, ROS bag (MCAP too) or ULog.",
        ),
    ],
    picture: Annotated[
        Path | None,
        options.optional("FILE", "none", "Plot the channels into a PNG or SVG file as well."),
    ] = None,
    rigs: options.OwnRigs = None,
    output: options.Output,
) -> None:
    """Show the channels of a measured file with units, sample rates, ranges and gaps, and propose its entry in a campaign."""
    with report_errors(output.debug):
        from rigsight.plot import encoded
        from rigsight.workflow.inspect import channel_picture, run_inspect
        from rigsight.workflow.own.own_rigs import own_rigs
        from rigsight.workflow.run.results import write_picture

        found = run_inspect(file, own_rigs(rigs or []).values())
        if picture is not None:
            write_picture(picture, lambda suffix: encoded(channel_picture(file), suffix, file.name))
    if output.json:
        show_as_json(found.to_json())
    elif not output.quiet:
        show(_channel_table(found))
        for name, (step, gaps) in found.times.items():
            told_gaps = "does not increase" if step is None else f"step {step:.6g}, {gaps} gaps"
            typer.echo(f"Time '{name}': {told_gaps}")
        for channel in found.channels:
            for remark in channel.remarks:
                typer.echo(f"'{channel.name}' {remark}.")
        for refused in found.refused:
            typer.echo(f"No signal: '{refused.name}' {refused.reason}")
        for note in found.notes:
            typer.echo(f"Note: {note}")
        typer.echo(f'\nFor a campaign with model = "{found.model}":\n\n{found.proposal}', nl=False)


def _channel_table(found: Inspection) -> Table:
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    from rigsight.records.stamps import written_stamp

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.5g}"

    def end(channel: ChannelSummary, stamp: float | None) -> str:
        return "" if stamp is None else written_stamp(stamp, channel.dt or 0.0, fewest=5)

    listed = found.channels
    columns = {
        "channel": [escape(c.name) for c in listed],
        "unit": [escape(c.unit or "") for c in listed],
        "samples": [str(c.n_samples) for c in listed],
        "rate": [f"{1.0 / c.dt:.6g}" if c.dt else "" for c in listed],
        "from": [end(c, c.t0) for c in listed],
        "to": [end(c, c.t1) for c in listed],
        "minimum": [number(c.minimum) for c in listed],
        "maximum": [number(c.maximum) for c in listed],
        "gaps": [str(c.n_gaps or "") for c in listed],
        "not finite": [str(c.n_not_finite or "") for c in listed],
    }
    # A column that is empty for all channels is left out.
    columns = {name: cells for name, cells in columns.items() if name == "channel" or any(cells)}
    title = escape(f"{found.file} ({found.format})")
    table = Table(title=title, box=box.SIMPLE, title_justify="left", collapse_padding=True)
    for name, cells in columns.items():
        if name in ("channel", "unit"):
            # Without a least width, numbers would leave a narrow terminal no room for the names.
            table.add_column(name, overflow="fold", min_width=min(max(map(len, cells)), _NAME_WIDTH))
        else:
            table.add_column(name, justify="right", no_wrap=True)
    for row in zip(*columns.values(), strict=True):
        table.add_row(*row)
    return table


@with_groups
def init(
    *,
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
    output: options.Output,
) -> None:
    """Write a commented campaign.toml for the measured files of a folder.

    Signals, units, kinds, amplitudes and roles are guessed; comments in the file mark each guess. An existing campaign is not
    overwritten. With --mjcf, the rig file of a robot model is written as well and checked against MuJoCo.
    """
    with output.reporting() as listener:
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
    if output.json:
        show_as_json(content)
    elif not output.quiet:
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
    return f"{remedy} Then: rigsight check {folder}, and rigsight diagnose {folder}"


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
    joint, _, value = text.rpartition("=")
    try:
        return joint, float(value)
    except ValueError:
        raise InputError(f"{option}: got '{text}'; write JOINT={number}, for instance {example}.") from None


@with_groups
def check(
    *,
    campaign: options.Campaign,
    out: options.ResultsFolder = Path("check"),
    effect: Annotated[
        list[str] | None,
        options.effect("Compare only this effect with the others that are named. May be repeated."),
    ] = None,
    own: options.OwnParts,
    output: options.Output,
) -> None:
    """Say in seconds what the records can show: their faults, the parameters they determine, the effects they tell apart.

    CAMPAIGN may be a rig file: then a simulated sweep takes the place of records. Writes check.json and check.html into DIR.
    """
    with output.reporting() as listener:
        from rigsight.workflow.check import CHECK_FILE, CHECK_PAGE, run_check

        read, command = own.named(effect, listener), command_line()
        found = run_check(campaign, out, **read, listener=listener, command=command)
    files = {"Page": out / CHECK_PAGE, "Results": out / CHECK_FILE}
    output.show(out / CHECK_FILE, lambda: _check_summary(found), files)


def _check_summary(found: Check) -> Group:
    from rich.console import Group
    from rich.markup import escape

    from rigsight.report.check import check_headline, effect_names, forms, rivals
    from rigsight.workflow.check import CHECK_PAGE

    findings = [(r.severity, f"{r.sentence} {r.remedy}") for r in found.remarks]
    apart, groups = [], dict[str, list[str]]()
    for rival in rivals(found.matrix):
        words = [rival.visible] if rival.visible else []
        words += [f"{by}: {names}" for by, names in rival.others]
        apart.append((rival.effect, rival.where, "; ".join(words)))
        group = rival.visible or "shows, but is not told apart from some effect of another family"
        groups.setdefault(group, []).append(f"{rival.effect} at {rival.where}")
    alike = [f"Forms of {family} that are not told apart: {names}." for family, names in forms(found.matrix)]
    heads = ("Effect", "Where", "Not told apart from")
    effects = [table(heads, apart)] if apart else ["All families of effects can be told apart."]
    if len(apart) > _MOST_ROWS:
        effects = [f"{group[:1].upper()}{group[1:]}: {', '.join(names)}." for group, names in groups.items()]
        effects.append(f"{CHECK_PAGE} shows which effects and forms are not told apart.")
        alike = []
    if found.matrix.hidden:
        alike.append(
            f"These records cannot show, at any size: {', '.join(effect_names(found.matrix.hidden))}."
        )
    return Group(
        check_headline(found),
        *([table(("", "Finding"), findings)] if findings else []),
        found.identifiability,
        *([found.matrix.reason] if found.matrix.reason else [*effects, *map(escape, alike)]),
    )
