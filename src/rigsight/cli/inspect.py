"""The command ``rigsight inspect``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import show, show_as_json

if TYPE_CHECKING:
    from rich.table import Table

    from rigsight.workflow.inspect import ChannelSummary, Inspection


_NAME_WIDTH = 16
"""Of the columns of names, at least, where they are as long."""


def inspect(
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
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Show the channels of a measured file with units, sample rates, ranges and gaps, and propose its entry in a campaign."""
    with report_errors(debug):
        from rigsight.plot import encoded
        from rigsight.workflow.inspect import channel_picture, run_inspect
        from rigsight.workflow.own.own_rigs import own_rigs
        from rigsight.workflow.run.results import write_picture

        found = run_inspect(file, own_rigs(rigs or []).values())
        if picture is not None:
            write_picture(picture, lambda suffix: encoded(channel_picture(file), suffix, file.name))
    if json:
        show_as_json(found.to_json())
    elif not quiet:
        show(_table(found))
        for name, (step, gaps) in found.times.items():
            told_gaps = "does not increase" if step is None else f"step {step:.6g}, {gaps} gaps"
            typer.echo(f"Time '{name}': {told_gaps}")
        for channel in found.channels:
            for remark in channel.remarks:
                typer.echo(f"'{channel.name}' {remark}.")
        for refused in found.refused:
            typer.echo(f"No signal: '{refused.name}' {refused.reason}")
        typer.echo(f'\nFor a campaign with model = "{found.model}":\n\n{found.proposal}', nl=False)


def _table(found: Inspection) -> Table:
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
