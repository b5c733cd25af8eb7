"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer


def effect_names(begun: str) -> list[str]:
    """Return the effects of the catalogue whose names begin with this text, for completion in the shell."""
    from rigsight.effects import CATALOGUE

    return [effect.name for effect in CATALOGUE if effect.name.startswith(begun)]


def optional(metavar: str, otherwise: str, about: str, *names: str) -> Any:
    """Return an option, and what is taken where it is not given; its name is that of the parameter where none is stated."""
    return typer.Option(*names, metavar=metavar, show_default=otherwise, help=about)


def effect(about: str, by_default: str = "the catalogue and your own") -> Any:
    """Return the option for the names of the effects with which a command does this."""
    return typer.Option(metavar="NAME", show_default=by_default, help=about, autocompletion=effect_names)


Campaign = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN", help="A campaign.toml or the folder that contains it.")
]
Model = Annotated[
    Path,
    typer.Argument(
        metavar="MODEL",
        help="A model.json, the folder that contains one, or a published set such as hysteresis_r.",
    ),
]
ResultsFolder = Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the results.")]
OwnEffects = Annotated[
    list[Path] | None,
    typer.Option(
        "--effects",
        metavar="FILE",
        show_default="none",
        help="A Python file that declares effects of your own; the file is executed. May be repeated.",
    ),
]
OwnRigs = Annotated[
    list[Path] | None,
    typer.Option(
        "--rigs",
        metavar="FILE",
        show_default="none",
        help="A rig file that declares a rig of your own, which can then be used by its name. May be repeated.",
    ),
]
Simulators = Annotated[
    list[str] | None,
    typer.Option(
        "--simulator",
        metavar="FILE.py:FUNCTION",
        show_default="none",
        help="A Python function that computes the motion of the bodies, for rig files with an external simulator; the Python "
        "file is executed. May be repeated.",
    ),
]
Seed = Annotated[
    int,
    typer.Option("--seed", min=0, max=2**63 - 1, help="Seed of all random numbers."),
]
Jobs = Annotated[
    int | None,
    typer.Option(
        "--jobs",
        "-j",
        min=1,
        show_default="one per processor",
        help="Number of parallel jobs: candidates fitted, records identified or trials run at the same time.",
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON instead of a summary.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
