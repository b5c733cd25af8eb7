"""What does ``rigsight effects`` accept, run and show?"""

from __future__ import annotations

import typer

from rigsight.cli.exit_codes import told
from rigsight.cli.options import Debug, OwnEffects, Quiet
from rigsight.workflow.progress_display import listening


def list_effects(
    effects: OwnEffects = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """List the effects that a diagnosis tries, and check effects of your own before they compete.

    A file's effects are simulated and fitted: exit code 2 and the reason if one does not keep what an effect promises.
    """
    with told(debug), listening(quiet) as listener:
        from rigsight.effects import CATALOGUE
        from rigsight.workflow.own_effects import equation_text, own_effects

        own = own_effects(effects or [], listener=listener)
        if quiet:
            return
        for effect in (*CATALOGUE, *own):
            typer.echo(f"{effect.name:28}{effect.place.value:18}{equation_text(effect)}")
        if own:
            typer.echo(f"\nYour own, checked: {', '.join(effect.name for effect in own)}")
