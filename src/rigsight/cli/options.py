"""Arguments and options that several commands share, some as groups, and what every command does with these groups."""

from __future__ import annotations

import contextlib
import functools
import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rigsight.cli.exit_codes import NOTHING, report_errors
from rigsight.cli.terminal import show, show_files, show_json
from rigsight.workflow.run.progress import Listener, listening, silent

if TYPE_CHECKING:
    from rich.console import RenderableType


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


def repeated(name: str, metavar: str, about: str) -> Any:
    """Return an option that may be given several times, or not at all."""
    return typer.Option(name, metavar=metavar, show_default="none", help=f"{about} May be repeated.")


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
    repeated("--effects", "FILE", "A Python file that declares effects of your own; the file is executed."),
]
OwnRigs = Annotated[
    list[Path] | None,
    repeated(
        "--rigs", "FILE", "A rig file that declares a rig of your own, which can then be used by its name."
    ),
]
Simulators = Annotated[
    list[str] | None,
    repeated(
        "--simulator",
        "FILE.py:FUNCTION",
        "A Python function that computes the motion of the bodies, for rig files with an external simulator; the Python file is "
        "executed.",
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


@dataclass(frozen=True)
class OwnParts:
    """Effects and rigs that a user adds to those of rigsight, read as the arguments that commands take."""

    effects: OwnEffects = None
    rigs: OwnRigs = None

    def read_rigs(self) -> dict[str, Any]:
        """Return the rigs."""
        from rigsight.workflow.own.own_rigs import own_rigs

        return {"own_rigs": list(own_rigs(self.rigs or []).values())}

    def read(self, listener: Listener = silent, *, check: bool = True) -> dict[str, Any]:
        """Return rigs and effects; without a check these are only to be simulated."""
        from rigsight.workflow.own.own_effects import own_effects

        rigs = self.read_rigs()
        return {**rigs, "own_effects": own_effects(self.effects or [], check=check, listener=listener)}

    def named(self, names: Sequence[str] | None, listener: Listener) -> dict[str, Any]:
        """Return rigs, effects, and the effects of these names, by default all."""
        from rigsight.workflow.own.own_effects import named

        read = self.read(listener)
        return {**read, "effects": named(names or [], read["own_effects"])}


@dataclass(frozen=True)
class Own(OwnParts):
    """The same with simulators, which move the bodies of some rigs."""

    simulator: Simulators = None

    def read_rigs(self) -> dict[str, Any]:
        """Register the simulators and return the rigs."""
        from rigsight.workflow.own.own_rigs import own_simulators

        own_simulators(self.simulator or [])
        return super().read_rigs()


@dataclass(frozen=True)
class Output:
    """What a command prints."""

    json: Json = False
    quiet: Quiet = False
    debug: Debug = False

    @contextlib.contextmanager
    def reporting(self, outcome: str = NOTHING) -> Iterator[Listener]:
        """Turn errors into messages and exit codes, and yield a listener that shows progress."""
        with report_errors(self.debug, outcome), listening(self.quiet) as listener:
            yield listener

    def show(self, result: Path, summary: Callable[[], RenderableType], files: Mapping[str, Path]) -> None:
        """Show a result that was written: its file as JSON where asked, else a summary and the paths of files."""
        if self.json:
            show_json(result)
        elif not self.quiet:
            show(summary())
            show_files(files)


def with_groups(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the options of each group of its parameters in place of the group, as the parser needs them."""
    signature = inspect.signature(command, eval_str=True)
    groups: dict[str, Any] = {
        name: own.annotation for name, own in signature.parameters.items() if is_dataclass(own.annotation)
    }
    options: list[inspect.Parameter] = []
    for name, own in signature.parameters.items():
        options += (
            inspect.signature(groups[name], eval_str=True).parameters.values() if name in groups else [own]
        )

    @functools.wraps(command)
    def called(**given: Any) -> None:
        for name, group in groups.items():
            given[name] = group(**{option.name: given.pop(option.name) for option in fields(group)})
        command(**given)

    named = [option.replace(kind=inspect.Parameter.KEYWORD_ONLY) for option in options]
    vars(called)["__signature__"] = signature.replace(parameters=named)
    return called
