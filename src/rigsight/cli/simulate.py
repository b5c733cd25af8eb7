"""The command ``rigsight simulate``, and how its ``--column`` and ``--initial-state`` are parsed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import show_as_json
from rigsight.errors import InputError
from rigsight.workflow.run.progress import listening

if TYPE_CHECKING:
    from rigsight.records import ColumnMapping


def simulate(
    model: options.Model,
    record: Annotated[
        Path,
        typer.Argument(
            metavar="RECORD", help="A measured file with time and inputs; further columns are ignored."
        ),
    ],
    out: Annotated[
        Path | None,
        options.optional(
            "FILE", "RECORD_simulated.csv in the current folder", "CSV file to write.", "--out", "-o"
        ),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SIGNAL=COLUMN",
            help="Column of a signal, by name or number: u=current or u=2. May be repeated.",
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        options.optional(
            "SIGNAL=UNIT",
            "the unit in the file, else SI",
            "Unit of a signal's column: t=ms. May be repeated.",
        ),
    ] = None,
    initial_state: Annotated[
        str | None,
        options.optional(
            "STATE=VALUE,...|estimated",
            "equilibrium at the first input sample",
            "Initial values of states (psi=0.01,w=0), or 'estimated' to fit them to the outputs in the record.",
        ),
    ] = None,
    constant: Annotated[
        list[str] | None,
        options.optional(
            "NAME=VALUE",
            "as in the model",
            "A constant of the rig with a different value in this record: m_load=1.2. May be repeated.",
        ),
    ] = None,
    effects: options.OwnEffects = None,
    rigs: options.OwnRigs = None,
    simulator: options.Simulators = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Predict the outputs of a model for the inputs of a record.

    Writes a CSV file with time, inputs and simulated outputs in SI units (running_gear: t,u,psi,y; axis: t,u,x; element:
    t,x,force).
    """
    file = out or Path(f"{record.stem}_simulated.csv")
    with report_errors(debug), listening(quiet):
        from rigsight.workflow.own.own_effects import own_effects
        from rigsight.workflow.own.own_rigs import own_rigs, own_simulators
        from rigsight.workflow.simulate import run_simulate

        own_simulators(simulator or [])
        simulated = run_simulate(
            model,
            record,
            file,
            columns=_columns(column or [], unit or []),
            initial_state=_states(initial_state),
            constants=_constants(constant or []),
            own_effects=own_effects(effects or [], check=False),
            own_rigs=own_rigs(rigs or []).values(),
        )
    if json:
        content = {"file": str(file), "n_samples": simulated.n_samples, "notes": list(simulated.notes)}
        show_as_json(content)
    elif not quiet:
        for note in simulated.notes:
            typer.echo(f"Note: {note}")
        typer.echo(f"{simulated.n_samples} samples simulated: {file}")


def _columns(columns: list[str], units: list[str]) -> dict[str, ColumnMapping]:
    from rigsight.records import ColumnMapping

    names = dict(_pair("--column", text, "SIGNAL=COLUMN, for instance u=current") for text in columns)
    unit_of = dict(_pair("--unit", text, "SIGNAL=UNIT, for instance t=ms") for text in units)
    mapped = {}
    for signal in dict.fromkeys((*names, *unit_of)):
        name = names.get(signal, signal)
        place = int(name) if name.isascii() and name.isdigit() else name
        mapped[signal] = ColumnMapping(place, unit=unit_of.get(signal))
    return mapped


def _constants(given: list[str]) -> dict[str, float]:
    constants = {}
    for text in given:
        name, value = _pair("--constant", text, "NAME=VALUE, for instance m_load=1.2")
        try:
            constants[name] = float(value)
        except ValueError:
            raise InputError(f"--constant '{text}' cannot be read; '{value}' is not a number.") from None
    return constants


def _pair(option: str, text: str, form: str) -> tuple[str, str]:
    signal, _, value = (part.strip() for part in text.partition("="))
    if not (signal and value):
        raise InputError(f"{option} '{text}' cannot be read; write {form}.")
    return signal, value


def _states(given: str | None) -> dict[str, float] | Literal["estimated"]:
    if given == "estimated":
        return "estimated"
    states = {}
    for text in (given or "").split(",") if given else []:
        name, _, value = text.partition("=")
        try:
            states[name.strip()] = float(value)
        except ValueError:
            raise InputError(
                f"--initial-state '{text}' cannot be read; write STATE=VALUE, for instance psi=0.01,w=0, or estimated."
            ) from None
        if not math.isfinite(states[name.strip()]):
            raise InputError(f"--initial-state '{text}' must be a finite number.")
    return states
