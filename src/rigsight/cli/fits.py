"""The commands that fit models to records and compare them: ``identify``, ``discover``, ``compare``, ``difference``, ``gate``."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigsight.cli import options
from rigsight.cli.options import with_groups
from rigsight.cli.terminal import command_line, table
from rigsight.errors import InputError

if TYPE_CHECKING:
    from rich.console import RenderableType

    from rigsight.compare import NumberCheck
    from rigsight.workflow.difference import Difference
    from rigsight.workflow.gate import Gate
    from rigsight.workflow.gating import Check

CLOSED = 1
"""Exit code of a closed gate."""


@with_groups
def identify(
    *,
    campaign: options.Campaign,
    out: options.ResultsFolder = Path("identification"),
    method: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Estimator of the frequency responses: local_rational or local_polynomial; for built-in rigs of one motion also "
            "h1 or thesis.",
        ),
    ] = "local_rational",
    resolution: Annotated[
        float | None,
        options.optional(
            "RAD_S",
            "chosen for each record",
            "Frequency resolution: width of the local bands, or spacing of the averaged frequencies.",
        ),
    ] = None,
    objective: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="What fits over time minimize: windows, the error with fitted initial states, over windows if the rig drifts; "
            "or free-run, the error of each whole record, from the state that its first samples give.",
        ),
    ] = "windows",
    initial_samples: Annotated[
        int | None,
        options.optional("N", "20", "Number of first samples that give the initial state of a free run."),
    ] = None,
    effect: Annotated[
        list[str] | None,
        options.effect(
            "Fit this effect as well, such as coulomb_friction@gearbox. May be repeated.",
            "the rig's own equations",
        ),
    ] = None,
    own: options.Own,
    seed: options.Seed = 0,
    jobs: options.Jobs = None,
    output: options.Output,
) -> None:
    """Identify the parameters of the rig from frequency responses and steps, for each record and for all together.

    Writes identification.json, model.json, amplitudes.svg, plots of the responses (for rigs of one motion a Bode plot for each
    record) and identification.html with the responses of every sensor to every input, the poles, and which parameters the records
    determine into DIR; all files or none. With --effect, model.json holds the rig with these effects.
    """
    with output.reporting() as listener:
        from rigsight.report.identification import identification_summary
        from rigsight.workflow.identify import run_identify

        # Effects of installed packages are checked only where some may be named.
        named = (
            own.named(effect, listener) if effect else own.read(listener) if own.effects else own.read_rigs()
        )
        found = run_identify(
            campaign,
            out,
            method=method,
            resolution=resolution,
            objective=objective,
            initial_samples=initial_samples,
            **named,
            seed=seed,
            n_jobs=jobs,
            listener=listener,
            command=command_line(),
        )
    page = {} if found.identifiability is None else {"Page": out / "identification.html"}
    files = {**page, "Results": out / "identification.json", "Model": out / "model.json"}
    output.show(out / "identification.json", lambda: identification_summary(found), files)


@with_groups
def discover(
    *,
    campaign: options.Campaign,
    out: options.ResultsFolder = Path("discovery"),
    one_by_one: Annotated[
        bool, typer.Option("--one-by-one", help="Also discover on each estimation record alone.")
    ] = False,
    own: options.Own,
    seed: options.Seed = 0,
    jobs: options.Jobs = None,
    output: options.Output,
) -> None:
    """Find the equations of motion from the records, by sparse regression and free-run simulation.

    Writes discovery.json, model.json and discovery.svg into DIR; all files or none. Laws that no catalogue has are written as
    effects for --effects: discovered.py has the powers of the equation, shape.py the shape of what it lacks.
    """
    with output.reporting() as listener:
        from rigsight.discover.result import LAWS_FILE, SHAPE_FILE
        from rigsight.report.terminal import discovery_summary
        from rigsight.workflow.discover import check_kept, run_discover

        check_kept(own.effects or [], out)
        read = own.read(listener)
        found = run_discover(
            campaign,
            out,
            effects=read["own_effects"],
            one_by_one=one_by_one,
            own_rigs=read["own_rigs"],
            seed=seed,
            n_jobs=jobs,
            listener=listener,
        )
    files = {"Results": out / "discovery.json", "Model": out / "model.json"}
    output.show(out / "discovery.json", lambda: discovery_summary(found), files)
    if output.json or output.quiet:
        return
    written = {LAWS_FILE: found.own_laws, SHAPE_FILE: found.offered}
    for file in (out / name for name, law in written.items() if law):
        for command in ("discover", "diagnose"):
            typer.echo(shlex.join(["rigsight", command, str(campaign), "--effects", str(file)]))


@with_groups
def compare(
    *,
    campaign: options.Campaign,
    model: Annotated[
        list[str],
        typer.Argument(
            metavar="MODEL...",
            help="Each a model.json, a folder that contains one, a published set such as hysteresis_r, or given for the "
            "simulation that the campaign gives. NAME=MODEL gives it a name in the results.",
        ),
    ],
    out: options.ResultsFolder = Path("comparison"),
    method: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Estimator of the frequency responses: local_rational, local_polynomial, h1 or thesis.",
        ),
    ] = "local_rational",
    step_seconds: Annotated[
        float, typer.Option(metavar="SECONDS", help="Time after a step over which it is compared.")
    ] = 4.0,
    own: options.Own,
    jobs: options.Jobs = None,
    output: options.Output,
) -> None:
    """Score models on all records: frequency responses, steps and free runs, each with its noise floor.

    Writes comparison.json, comparison.csv, comparison.html and figures into DIR; all files or none.
    """
    with output.reporting() as listener:
        from rigsight.report.comparison import comparison_summary
        from rigsight.workflow.compare import run_compare

        found = run_compare(
            campaign,
            model,
            out,
            method=method,
            step_seconds=step_seconds,
            **own.read(check=False),
            n_jobs=jobs,
            listener=listener,
            command=command_line(),
        )
    files = {"Page": out / "comparison.html", "Table": out / "comparison.csv"}
    output.show(out / "comparison.json", lambda: comparison_summary(found), files)


@with_groups
def difference(
    *,
    diagnoses: Annotated[
        list[Path],
        typer.Argument(
            metavar="A B...", help="Folders that 'rigsight diagnose' wrote, or campaigns, in their order."
        ),
    ],
    out: options.ResultsFolder = Path("difference"),
    at: Annotated[
        str | None,
        options.optional(
            "VALUE,...", "the order", "Axis of the trend of three or more, such as temperatures: 20,40,60."
        ),
    ] = None,
    own: options.OwnParts,
    jobs: options.Jobs = None,
    output: options.Output,
) -> None:
    """Show which numbers changed between units, dates or temperatures, and which only look changed.

    Each is the folder of a diagnosis, or a campaign, whose rig is then identified. Writes difference.json and a picture into DIR.
    """
    with output.reporting() as listener:
        from rigsight.workflow.difference import DIFFERENCE_FILE, PICTURE_FILE, run_difference

        axis, read = None if at is None else _values(at), own.read(check=False)
        found = run_difference(diagnoses, out, at=axis, **read, n_jobs=jobs, listener=listener)
    files = {"Table": out / DIFFERENCE_FILE, "Picture": out / PICTURE_FILE}
    if not files["Picture"].exists():
        del files["Picture"]
    output.show(out / DIFFERENCE_FILE, lambda: _difference_summary(found), files)


def _values(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"--at '{text}' cannot be read; write numbers, for instance 20,40,60.") from None


def _difference_summary(found: Difference) -> RenderableType:
    from rich.console import Group
    from rich.markup import escape

    from rigsight.plot.drawing import with_unit
    from rigsight.report.labels import plain, written

    rows = []
    for row in found.rows:
        values = ["" if own is None else plain(written(own.value, own.with_scatter)) for own in row.values]
        trend = "" if row.trend is None else f" (slope {row.trend.slope:.2g} +/- {row.trend.std:.1g})"
        apart = "" if row.difference != row.difference else f"{row.difference:+.1f}"
        rows.append((with_unit(row.name, row.unit), *values, apart, row.verdict + trend))
    heads = ("Number", *(unit.name for unit in found.units), "In errors", "")
    return Group(table(heads, rows), escape(found.conclusion))


@with_groups
def gate(
    *,
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
    own: options.Own,
    output: options.Output,
) -> None:
    """Check whether a model still holds for new records; exit code 1 where a gap exceeds its limit.

    Writes gate.json into DIR, and JUnit XML if asked.
    """
    with output.reporting() as listener:
        from rigsight.workflow.gate import GATE_FILE, run_gate

        found = run_gate(
            model,
            records,
            out,
            campaign=campaign,
            floors=floors,
            limits=limit or [],
            junit=junit,
            **own.read(check=False),
            listener=listener,
        )
    files = {"Checks": out / GATE_FILE, **({} if junit is None else {"JUnit": junit})}
    output.show(out / GATE_FILE, lambda: _gate_summary(found), files)
    if found.closed:
        raise typer.Exit(CLOSED)


def _gate_summary(found: Gate) -> RenderableType:
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
