"""The command ``rigsight difference``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import Debug, Jobs, Json, OwnEffects, OwnRigs, Quiet, ResultsFolder
from rigsight.cli.terminal import show, show_files, show_json
from rigsight.errors import InputError
from rigsight.workflow.run.progress import listening

if TYPE_CHECKING:
    from rich.console import RenderableType

    from rigsight.workflow.difference import Difference


def difference(
    diagnoses: Annotated[
        list[Path],
        typer.Argument(
            metavar="A B...", help="Folders that 'rigsight diagnose' wrote, or campaigns, in their order."
        ),
    ],
    out: ResultsFolder = Path("difference"),
    at: Annotated[
        str | None,
        typer.Option(
            "--at",
            metavar="VALUE,...",
            show_default="the order",
            help="Axis of the trend of three or more, such as temperatures: 20,40,60.",
        ),
    ] = None,
    effects: OwnEffects = None,
    rigs: OwnRigs = None,
    jobs: Jobs = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Show which numbers changed between units, dates or temperatures, and which only look changed.

    Each is the folder of a diagnosis, or a campaign, whose rig is then identified. Writes difference.json and a picture into DIR.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.workflow.difference import DIFFERENCE_FILE, PICTURE_FILE, run_difference
        from rigsight.workflow.own.own_effects import own_effects
        from rigsight.workflow.own.own_rigs import own_rigs

        found = run_difference(
            diagnoses,
            out,
            at=None if at is None else _values(at),
            own_effects=own_effects(effects or [], check=False),
            own_rigs=list(own_rigs(rigs or []).values()),
            n_jobs=jobs,
            listener=listener,
        )
    if json:
        show_json(out / DIFFERENCE_FILE)
    elif not quiet:
        show(_summary(found))
        files = {"Table": out / DIFFERENCE_FILE}
        show_files({**files, "Picture": out / PICTURE_FILE} if (out / PICTURE_FILE).exists() else files)


def _values(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"--at '{text}' cannot be read; write numbers, for instance 20,40,60.") from None


def _summary(found: Difference) -> RenderableType:
    from rich import box
    from rich.console import Group
    from rich.markup import escape
    from rich.table import Table

    from rigsight.report.labels import unit_text

    table = Table("Number", *(escape(unit.name) for unit in found.units), "In errors", "", box=box.SIMPLE)
    for row in found.rows:
        values = ["" if own is None else f"{own.value:.4g} +/- {own.with_scatter:.2g}" for own in row.values]
        trend = "" if row.trend is None else f" (slope {row.trend.slope:.2g} +/- {row.trend.std:.1g})"
        apart = "" if row.difference != row.difference else f"{row.difference:+.1f}"
        table.add_row(
            f"{row.name} [{unit_text(row.unit)}]".replace("[", r"\["), *values, apart, row.verdict + trend
        )
    return Group(table, escape(found.conclusion))
