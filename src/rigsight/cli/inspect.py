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

    from rigsight.workflow.inspect import Inspection


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
        typer.Option(
            "--picture",
            metavar="FILE",
            show_default="none",
            help="Plot the channels into a PNG or SVG file as well.",
        ),
    ] = None,
    rigs: options.OwnRigs = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Show the channels of a measured file with units, sample rates, ranges and gaps, and propose its entry in a campaign."""
    with report_errors(debug):
        from rigsight.plot import channel_plots, encoded
        from rigsight.workflow.inspect import plotted_channels, run_inspect
        from rigsight.workflow.own.own_rigs import own_rigs
        from rigsight.workflow.run.results import write_picture

        found = run_inspect(file, own_rigs(rigs or []).values())
        if picture is not None:
            plots = plotted_channels(file)
            write_picture(picture, lambda suffix: encoded(channel_plots(plots), suffix, file.name))
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

    headings = (
        "channel",
        "unit",
        "samples",
        "rate",
        "from",
        "to",
        "minimum",
        "maximum",
        "gaps",
        "not finite",
    )
    rows = []
    for channel in found.channels:
        rate = "" if not channel.dt else f"{1.0 / channel.dt:.6g}"
        ends = (
            "" if stamp is None else written_stamp(stamp, channel.dt or 0.0, fewest=5)
            for stamp in (channel.t0, channel.t1)
        )
        rows.append(
            (
                escape(channel.name),
                escape(channel.unit or ""),
                str(channel.n_samples),
                rate,
                *ends,
                *("" if number is None else f"{number:.5g}" for number in (channel.minimum, channel.maximum)),
                str(channel.n_gaps or ""),
                str(channel.n_not_finite or ""),
            )
        )
    # A column that is empty for all channels is left out.
    told_of = [i for i in range(len(headings)) if i == 0 or any(row[i] for row in rows)]
    title = escape(f"{found.file} ({found.format})")
    table = Table(title=title, box=box.SIMPLE, title_justify="left", collapse_padding=True)
    for i in told_of:
        if i < 2:
            # Without a least width, numbers would leave a narrow terminal no room for the names.
            longest = max(len(row[i]) for row in rows)
            table.add_column(headings[i], overflow="fold", min_width=min(longest, _NAME_WIDTH))
        else:
            table.add_column(headings[i], justify="right", no_wrap=True)
    for row in rows:
        table.add_row(*(row[i] for i in told_of))
    return table
