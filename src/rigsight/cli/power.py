"""The command ``rigsight power``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import (
    Campaign,
    Debug,
    Json,
    OwnEffects,
    OwnRigs,
    Quiet,
    ResultsFolder,
    Seed,
    effect_names,
)
from rigsight.cli.terminal import show, show_files, show_json
from rigsight.workflow.run.progress import listening

if TYPE_CHECKING:
    from rich.table import Table

    from rigsight.workflow.power import Power


def power(
    campaign: Campaign,
    out: ResultsFolder = Path("power"),
    effect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            show_default="the catalogue and your own",
            help="Ask only for this effect. May be repeated.",
            autocompletion=effect_names,
        ),
    ] = None,
    effects: OwnEffects = None,
    rigs: OwnRigs = None,
    seed: Seed = 0,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Show the smallest size of each effect that these records would have named, before you trust that nothing is missing.

    Writes power.json into DIR.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.workflow.own.own_effects import named, own_effects
        from rigsight.workflow.own.own_rigs import own_rigs
        from rigsight.workflow.power import run_power

        own = own_effects(effects or [], listener=listener)
        found = run_power(
            campaign,
            out,
            effects=named(effect or [], own),
            own_effects=own,
            own_rigs=own_rigs(rigs or []).values(),
            seed=seed,
            listener=listener,
        )
    if json:
        show_json(out / "power.json")
    elif not quiet:
        show(_table(found))
        show_files({"Sizes": out / "power.json"})


def _table(found: Power) -> Table:
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    from rigsight.report.labels import effect_label, unit_text

    table = Table("Effect", "Where", "Named from", box=box.SIMPLE)
    for size in found.sizes:
        values = [
            f"{name} = {value:.3g} {unit_text(unit)}".strip()
            for name, (value, unit) in size.parameters.items()
        ]
        words = values[0] + (f" (with {', '.join(values[1:])})" if values[1:] else "") if values else ""
        table.add_row(effect_label(size.effect), escape(size.where), escape(words or size.reason))
    return table
