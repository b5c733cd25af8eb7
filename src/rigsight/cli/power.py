"""The command ``rigsight power``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import show, show_files, show_json, table
from rigsight.workflow.run.progress import listening

if TYPE_CHECKING:
    from rich.table import Table

    from rigsight.workflow.power import Power


def power(
    campaign: options.Campaign,
    out: options.ResultsFolder = Path("power"),
    effect: Annotated[list[str] | None, options.effect("Ask only for this effect. May be repeated.")] = None,
    effects: options.OwnEffects = None,
    rigs: options.OwnRigs = None,
    seed: options.Seed = 0,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
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
    from rigsight.report.labels import effect_label, unit_text

    rows = []
    for size in found.sizes:
        values = [
            f"{name} = {value:.3g} {unit_text(unit)}".strip()
            for name, (value, unit) in size.parameters.items()
        ]
        words = values[0] + (f" (with {', '.join(values[1:])})" if values[1:] else "") if values else ""
        rows.append((effect_label(size.effect), size.where, words or size.reason))
    return table(("Effect", "Where", "Named from"), rows)
