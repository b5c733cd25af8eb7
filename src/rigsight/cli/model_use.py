"""The commands that use a model: ``simulate``, ``vary`` and ``export``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import with_groups
from rigsight.cli.terminal import show_as_json, show_json
from rigsight.errors import InputError

if TYPE_CHECKING:
    from rigsight.records import ColumnMapping
    from rigsight.simulate.input_hold import Hold


@with_groups
def simulate(
    *,
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
    own: options.Own,
    output: options.Output,
) -> None:
    """Predict the outputs of a model for the inputs of a record.

    Writes a CSV file with time, inputs and simulated outputs in SI units (running_gear: t,u,psi,y; axis: t,u,x; element:
    t,x,force).
    """
    file = out or Path(f"{record.stem}_simulated.csv")
    with output.reporting():
        from rigsight.workflow.simulate import run_simulate

        read = own.read(check=False)
        simulated = run_simulate(
            model,
            record,
            file,
            columns=_columns(column or [], unit or []),
            initial_state=_states(initial_state),
            constants=_constants(constant or []),
            **read,
        )
    if output.json:
        content = {"file": str(file), "n_samples": simulated.n_samples, "notes": list(simulated.notes)}
        show_as_json(content)
    elif not output.quiet:
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


@with_groups
def vary(
    *,
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL",
            help="A model.json, a folder that contains one, or a published set such as hysteresis_r.",
        ),
    ],
    parameter: Annotated[
        list[str],
        typer.Option(metavar="NAME", help="The parameter to vary. May be repeated; each gives one figure."),
    ],
    low: Annotated[
        float | None,
        options.optional("VALUE", "half the value in the model", "First value.", "--from"),
    ] = None,
    high: Annotated[
        float | None,
        options.optional("VALUE", "twice the value in the model", "Last value.", "--to"),
    ] = None,
    steps: Annotated[int, typer.Option(help="Number of values.")] = 5,
    amplitude: Annotated[float, typer.Option(help="Amplitude of the sweep, in the unit of the input.")] = 1.0,
    lowest: Annotated[
        float | None,
        options.optional("OMEGA", "1/12 of the natural frequency", "Lower end of the band [rad/s]."),
    ] = None,
    highest: Annotated[
        float | None,
        options.optional("OMEGA", "6 times the natural frequency", "Upper end of the band [rad/s]."),
    ] = None,
    source: Annotated[
        str | None,
        options.optional("NAME", "the first", "Input to sweep.", "--input"),
    ] = None,
    response: Annotated[
        str | None,
        options.optional("NAME", "the first", "Output whose response is shown.", "--output"),
    ] = None,
    own: options.Own,
    out: options.ResultsFolder = Path("vary"),
    output: options.Output,
) -> None:
    """Show how the frequency response of a model changes with a parameter.

    Writes vary.svg, vary.png (vary_NAME.svg, ... for several parameters) and vary.json into DIR; all files or none.
    """
    with output.reporting() as listener:
        from rigsight.workflow.vary import run_vary, table_text

        read = own.read(check=False)
        if (lowest is None) != (highest is None):
            raise InputError("--lowest and --highest must be given together: give both, or neither.")
        band = None if lowest is None or highest is None else (lowest, highest)
        variations = run_vary(
            model,
            parameter,
            out,
            low=low,
            high=high,
            steps=steps,
            amplitude=amplitude,
            band=band,
            source=source,
            response=response,
            **read,
            listener=listener,
        )
    if output.json:
        show_json(out / "vary.json")
    elif not output.quiet:
        for variation in variations:
            typer.echo(table_text(variation) + "\n")
        typer.echo(f"Figures and values: {out}")


@with_groups
def export(
    *,
    model: options.Model,
    to: Annotated[
        str,
        typer.Option(
            metavar="TARGET",
            help="python, control, c, fmu (FMI 2.0), fmu3 (FMI 3.0), matlab, latex, modelica, mjcf, isaac or usd.",
        ),
    ],
    out: Annotated[
        Path | None,
        options.optional(
            "FILE",
            "the rig's name with the target's suffix",
            "File to write; the function, C prefix or model gets its name.",
            "--out",
            "-o",
        ),
    ] = None,
    hold: Annotated[
        str | None,
        options.optional(
            "HOLD", "the model's", "Behavior of the input between samples: zoh (constant) or foh (linear)."
        ),
    ] = None,
    step: Annotated[
        float | None,
        options.optional(
            "SECONDS",
            "from the time constants of the model",
            "Largest internal time step (python, matlab); physics time step (isaac, usd).",
        ),
    ] = None,
    source_only: Annotated[
        bool,
        typer.Option("--source-only", help="Write an FMU without a binary; the importing tool compiles it."),
    ] = False,
    mjcf: Annotated[
        Path | None,
        options.optional(
            "FILE",
            "(none)",
            "For mjcf, isaac and usd: the MuJoCo model or URDF from which rigsight init made the rig.",
        ),
    ] = None,
    usd: Annotated[
        Path | None,
        options.optional(
            "FILE",
            "(none)",
            "For usd: the robot, whose joints are found by their names. Without it they are written at /Robot/joints.",
        ),
    ] = None,
    campaign: Annotated[
        Path | None,
        options.optional(
            "CAMPAIGN",
            "(none)",
            "For mjcf: simulate the validation records of this campaign in MuJoCo with the written model.",
        ),
    ] = None,
    own: options.OwnParts,
    output: options.Output,
) -> None:
    """Write a model for other tools, such as C, MATLAB, an FMU or MuJoCo.

    Writes one file with the equations, the parameter values and their units; it runs without rigsight. mjcf, isaac and usd
    write parameter values and effects into the fields of MuJoCo, Isaac Lab and USD, and list what these have no field for.
    """
    with report_errors(output.debug):
        from rigsight.workflow.export import run_export

        written = run_export(
            model,
            to,
            out,
            hold=cast("Hold | None", hold),
            step=step,
            source_only=source_only,
            robot=mjcf,
            usd=usd,
            campaign=campaign,
            **own.read(check=False),
        )
    if output.json:
        fields: dict[str, object] = {
            "written": list(written.written),
            "without_field": list(written.without_field),
        }
        gap = {one.sensor: {"mujoco": one.in_mujoco, "model": one.in_model} for one in written.gap}
        if gap:
            fields["gap"] = gap
        show_as_json({"target": to, "file": str(written.path), **(fields if mjcf is not None else {})})
    elif not output.quiet:
        typer.echo(f"{to}: {written.path}")
        for line in written.written:
            typer.echo(f"Written: {line}")
        for line in written.without_field:
            typer.echo(f"No field for: {line}")
        for one in written.gap:
            typer.echo(
                f"Gap in {one.sensor}: {one.in_mujoco:.2%} in MuJoCo, {one.in_model:.2%} in rigsight (validation records)"
            )
