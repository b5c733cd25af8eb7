"""What does ``rigsight inspect`` accept, run and show?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli.exit_codes import told
from rigsight.cli.options import Debug, Quiet
from rigsight.cli.terminal import show

if TYPE_CHECKING:
    from rich.table import Table

    from rigsight.workflow.inspect import Inspection


def inspect(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="A measured file: CSV, MATLAB, HDF5, MDF4, TDMS, Parquet or UFF."
        ),
    ],
    json: Annotated[bool, typer.Option("--json", help="Print the same for machines.")] = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Look into a measured file: channels, units, rates, ranges, gaps, and how a campaign would name them."""
    with told(debug):
        from rigsight.workflow.inspect import run_inspect
        from rigsight.workflow.results import json_text

        found = run_inspect(file)
        text = json_text(found.to_json()) if json else ""
    if json:
        typer.echo(text, nl=False)
    elif not quiet:
        show(_table(found))
        for name, (step, gaps) in found.times.items():
            told_gaps = "does not rise" if step is None else f"step {step:.6g}, {gaps} gaps"
            typer.echo(f"Time '{name}': {told_gaps}")
        for refused in found.refused:
            typer.echo(f"No signal: '{refused.name}' {refused.reason}")
        typer.echo(f'\nFor a campaign with model = "{found.model}":\n\n{found.proposal}', nl=False)


def _table(found: Inspection) -> Table:
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(f"{found.file} ({found.format})"), box=box.SIMPLE, title_justify="left")
    table.add_column("channel", overflow="fold")
    table.add_column("unit")
    for heading in ("samples", "rate", "from", "to", "minimum", "maximum", "gaps", "not finite"):
        table.add_column(heading, justify="right")
    for channel in found.channels:
        rate = "" if not channel.dt else f"{1.0 / channel.dt:.6g}"
        numbers = (channel.t0, channel.t1, channel.minimum, channel.maximum)
        table.add_row(
            escape(channel.name),
            escape(channel.unit or ""),
            str(channel.n_samples),
            rate,
            *("" if number is None else f"{number:.5g}" for number in numbers),
            "" if channel.n_gaps is None else str(channel.n_gaps),
            str(channel.n_not_finite or ""),
        )
    return table
