"""The list of commands, in the order in which they are shown, and the options common to all."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Annotated

import typer

from rigsight.cli.diagnosis import demo, diagnose, plan, power, reproduce
from rigsight.cli.exit_codes import ended_by_signals, report_errors, report_output_errors
from rigsight.cli.fits import compare, difference, discover, gate, identify
from rigsight.cli.model_use import export, simulate, vary
from rigsight.cli.overview import list_effects, list_rigs, open_app
from rigsight.cli.records import check, init, inspect
from rigsight.errors import InputError

_BENCH = "rigsight_bench"
REFUSES = {"allow_extra_args": True, "ignore_unknown_options": True}
"""Settings of a command that ends with the same message whatever its options are."""


def blind_command() -> Callable[..., None]:
    """Return the command of the bench, or `not_installed`."""
    if find_spec(_BENCH) is None:
        return not_installed
    command: Callable[..., None] = import_module(f"{_BENCH}.command").blind
    return command


def not_installed() -> None:
    """Diagnose trials whose true effect is withheld, and score the verdicts: needs 'pip install ./bench'.

    The blind bench is a package of its own, rigsight-bench, in the folder bench/ of rigsight's repository.
    """
    with report_errors(debug=False):
        raise InputError(
            "The blind bench is a package of its own, rigsight-bench, which is not installed. "
            "In a copy of rigsight's repository: pip install ./bench"
        )


COMMANDS: dict[str, Callable[..., None]] = {
    "demo": demo,
    "app": open_app,
    "inspect": inspect,
    "init": init,
    "check": check,
    "diagnose": diagnose,
    "plan": plan,
    "power": power,
    "reproduce": reproduce,
    "identify": identify,
    "discover": discover,
    "compare": compare,
    "difference": difference,
    "simulate": simulate,
    "gate": gate,
    "export": export,
    "vary": vary,
    "blind": blind_command(),
    "effects": list_effects,
    "rigs": list_rigs,
}
"""In the order in which ``rigsight --help`` shows them."""

app = typer.Typer(
    name="rigsight",
    help="Find the effect that is missing in the simulation of a rig, from measured records, and how far it closes the gap.",
    epilog="'rigsight COMMAND --help' describes a command. Start with 'rigsight demo'.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def main() -> None:
    """Run the command line."""
    # Candidates are fitted in parallel; multithreaded matrix products would only compete for the same processors.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with report_output_errors(), ended_by_signals():
        app()


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"rigsight {version('rigsight')}")
        raise typer.Exit


@app.callback()
def rigsight(
    _version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Find the effect that is missing in the simulation of a rig, from measured records, and how far it closes the gap."""


for _name, _command in COMMANDS.items():
    app.command(_name, context_settings=REFUSES if _command is not_installed else None)(_command)
