"""The command ``rigsight export``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from rigsight.cli import options
from rigsight.cli.exit_codes import report_errors
from rigsight.cli.terminal import show_as_json

if TYPE_CHECKING:
    from rigsight.simulate.input_hold import Hold


def export(
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
    effects: options.OwnEffects = None,
    rigs: options.OwnRigs = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
    debug: options.Debug = False,
) -> None:
    """Write a model for other tools, such as C, MATLAB, an FMU or MuJoCo.

    Writes one file with the equations, the parameter values and their units; it runs without rigsight. mjcf, isaac and usd
    write parameter values and effects into the fields of MuJoCo, Isaac Lab and USD, and list what these have no field for.
    """
    with report_errors(debug):
        from rigsight.workflow.export import run_export
        from rigsight.workflow.own.own_effects import own_effects
        from rigsight.workflow.own.own_rigs import own_rigs

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
            own_effects=own_effects(effects or [], check=False),
            own_rigs=own_rigs(rigs or []).values(),
        )
    if json:
        fields: dict[str, object] = {
            "written": list(written.written),
            "without_field": list(written.without_field),
        }
        gap = {one.sensor: {"mujoco": one.in_mujoco, "model": one.in_model} for one in written.gap}
        if gap:
            fields["gap"] = gap
        show_as_json({"target": to, "file": str(written.path), **(fields if mjcf is not None else {})})
    elif not quiet:
        typer.echo(f"{to}: {written.path}")
        for line in written.written:
            typer.echo(f"Written: {line}")
        for line in written.without_field:
            typer.echo(f"No field for: {line}")
        for one in written.gap:
            typer.echo(
                f"Gap in {one.sensor}: {one.in_mujoco:.2%} in MuJoCo, {one.in_model:.2%} in rigsight (validation records)"
            )
