"""The command ``rigsight gate``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import show, show_files, show_json, table
from rigsight.workflow.run.progress import listening

if TYPE_CHECKING:
    from rich.console import RenderableType

    from rigsight.compare import NumberCheck
    from rigsight.workflow.gate import Gate
    from rigsight.workflow.gating import Check

CLOSED = 1
"""Exit code of a closed gate."""


def gate(
    model: options.Model,
    records: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDS...",
            help="New records: a campaign.toml, the folder that contains it, or measured files.",
        ),
    ],
    out: options.ResultsFolder = Path("gate"),
    campaign: Annotated[
        Path | None,
        options.optional(
            "CAMPAIGN",
            "the diagnosis beside the model",
            "Records for which the model is known to hold; its first record says how measured files are read.",
        ),
    ] = None,
    floors: Annotated[
        float | None,
        options.optional(
            "X", "what a true record rarely exceeds", "Limit of every gap in noise floors of its sensor."
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        options.optional(
            "SENSOR=VALUE UNIT",
            "as --floors",
            "Limit of the gap of a sensor: 'psi=0.1 deg'. May be repeated.",
        ),
    ] = None,
    junit: Annotated[
        Path | None,
        options.optional("FILE", "none", "Write the checks as JUnit XML."),
    ] = None,
    effects: options.OwnEffects = None,
    rigs: options.OwnRigs = None,
    simulator: options.Simulators = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Check whether a model still holds for new records; exit code 1 where a gap exceeds its limit.

    Writes gate.json into DIR, and JUnit XML if asked.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.workflow.gate import GATE_FILE, run_gate
        from rigsight.workflow.own.own_effects import own_effects
        from rigsight.workflow.own.own_rigs import own_rigs, own_simulators

        own_simulators(simulator or [])
        found = run_gate(
            model,
            records,
            out,
            campaign=campaign,
            floors=floors,
            limits=limit or [],
            junit=junit,
            own_effects=own_effects(effects or [], check=False),
            own_rigs=list(own_rigs(rigs or []).values()),
            listener=listener,
        )
    if json:
        show_json(out / GATE_FILE)
    elif not quiet:
        show(_summary(found))
        show_files({"Checks": out / GATE_FILE, **({} if junit is None else {"JUnit": junit})})
    if found.closed:
        raise typer.Exit(CLOSED)


def _summary(found: Gate) -> RenderableType:
    from rich.console import Group
    from rich.markup import escape

    from rigsight.workflow.gate import suspect_text

    rows = [
        (
            own.record,
            own.output,
            f"{own.gap:.3g} {own.unit}",
            f"{own.gap / own.floor:.3g}",
            "" if own.usual is None else f"{own.usual:.3g}",
            f"{own.limit:.3g}",
            "closed" if own.closed else "",
        )
        for own in found.checks
    ]
    lines = [
        f"The gate is {'closed' if found.closed else 'open'}: {_share(found.checks)} gaps exceed their limits"
        + (
            f", {_share(found.numbers)} numbers, asked one at a time, lie outside their usual range."
            if found.numbers
            else "."
        ),
        *(f"'{name}' cannot be simulated: {reason}" for name, reason in found.failures.items()),
        suspect_text(found),
        *(f"Note: {note}" for note in found.notes),
    ]
    heads = ("Record", "Sensor", "Gap", "In floors", "Usual", "Limit", "")
    return Group(table(heads, rows), *(escape(line) for line in lines if line))


def _share(checks: Sequence[Check | NumberCheck]) -> str:
    return f"{sum(own.closed for own in checks)} of {len(checks)}"
