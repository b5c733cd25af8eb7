"""The command ``rigsight effects``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import show_as_json
from rigsight.workflow.run.progress import listening

if TYPE_CHECKING:
    from rigsight.effects import Effect


def list_effects(
    effects: options.OwnEffects = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """List the effects that a diagnosis tries, and check effects of your own.

    The effects of a file are simulated and fitted. If one fails a check, the reason is printed and the exit code is 2.
    """
    with report_errors(debug), listening(quiet) as listener:
        from rigsight.effects import CATALOGUE
        from rigsight.workflow.own.own_effects import equation_text, own_effects

        own = own_effects(effects or [], listener=listener)
        if json:
            show_as_json({"effects": _listed((*CATALOGUE, *own))})
            return
        if quiet:
            return
        for effect in (*CATALOGUE, *own):
            typer.echo(f"{effect.name:34}{effect.place.value:18}{equation_text(effect)}")
        if own:
            typer.echo(f"\nYour own, checked: {', '.join(effect.name for effect in own)}")


def _listed(effects: Iterable[Effect]) -> list[dict[str, object]]:
    return [
        {
            "name": effect.name,
            "where": effect.place.value,
            "summary": effect.summary,
            "equations": {name: str(expression) for name, expression in effect.equations.items()},
            "states": [
                {
                    "name": str(s.symbol),
                    "rate": str(s.rate),
                    "limit": None if s.limit is None else str(s.limit),
                }
                for s in effect.states
            ],
            "parameters": [
                {
                    "name": p.name,
                    "description": p.description,
                    "dimension": p.dimension,
                    "vanishes_at": p.null,
                }
                for p in effect.parameters
            ],
        }
        for effect in effects
    ]
