"""How does a command line become one call of a public function, and an error an exit code?

Exit codes: 0 success, 1 a defect of rigsight, 2 input that cannot be used, 130 interrupted. Everything heavy is imported
inside the commands, so that ``rigsight --help`` answers at once.
"""

from __future__ import annotations

import contextlib
import math
import os
import shlex
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NoReturn

import typer

from rigsight.errors import InputError, RigsightError

if TYPE_CHECKING:
    from rich.console import RenderableType

    from rigsight.diagnose import Diagnosis
    from rigsight.records import ColumnMapping
    from rigsight.workflow.progress import Listener

BAD_INPUT, DEFECT, INTERRUPTED = 2, 1, 130

app = typer.Typer(
    name="rigsight",
    help="Name the effect that the simulation of a rig leaves out, from measured records, and say how far the gap shrinks.",
    epilog="'rigsight COMMAND --help' tells more. Start with 'rigsight demo'.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but errors.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random.")]
Jobs = Annotated[
    int | None,
    typer.Option(
        "--jobs",
        "-j",
        min=1,
        show_default="one per processor",
        help="Candidates fitted, records identified or trials run at the same time.",
    ),
]
OwnEffects = Annotated[
    list[Path] | None,
    typer.Option(
        "--effects",
        metavar="FILE",
        show_default="none",
        help="A Python file that declares effects of your own; it is run. May be repeated.",
    ),
]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


def main() -> None:
    """Run the command line."""
    # Candidates are fitted side by side; matrix products that spread over the same processors only wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        app()
    except KeyboardInterrupt:
        _leave("interrupted; nothing was written.", INTERRUPTED)


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
    """Name the effect that the simulation of a rig leaves out, from measured records, and say how far the gap shrinks."""


@contextlib.contextmanager
def _told(debug: bool, left: str = "nothing was written") -> Iterator[None]:
    """Map errors of a command to one message on stderr and an exit code."""
    if debug:
        yield
        return
    try:
        with warnings.catch_warnings():
            # Trial parameters far off the mark overflow; fits expect that and go elsewhere.
            warnings.simplefilter("ignore")
            yield
    except RigsightError as error:
        _leave(str(error), BAD_INPUT)
    except KeyboardInterrupt:
        _leave(f"interrupted; {left}.", INTERRUPTED)
    except BrokenPipeError:
        raise
    except MemoryError:
        _leave("this needs more memory than there is. Shorten the records, or lower --jobs.", BAD_INPUT)
    except Exception as error:
        text = " ".join(str(error).split())[:300]
        _leave(
            f"a defect of rigsight, not of your data: {type(error).__name__}: {text}. "
            "Please report it with the output of the same command with --debug added.",
            DEFECT,
        )


def _leave(message: str, code: int) -> NoReturn:
    typer.echo(f"rigsight: {message}", err=True)
    raise SystemExit(code)


@app.command()
def demo(
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for campaign and results.")
    ] = Path("demo"),
    seed: Seed = 0,
    jobs: Jobs = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Run the whole chain on a virtual rig whose simulation misses an effect.

    Writes DIR/campaign (records and campaign.toml, as a measurement would leave them), diagnosis.json, model.json, report.html.
    """
    with _told(debug), _listening(quiet) as listener:
        from rigsight.workflow.demo import HIDDEN_EFFECT, run_demo

        diagnosis = run_demo(out, seed=seed, n_jobs=jobs, listener=listener, command=_command_line())
    if not quiet:
        _show(diagnosis)
        typer.echo(f"\nThe virtual rig hid {HIDDEN_EFFECT}; the diagnosis was not told.")
        _show_files(out, f"rigsight diagnose {shlex.quote(str(out / 'campaign'))} repeats it.")


@app.command()
def diagnose(
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN", help="A campaign.toml or the folder that holds one.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the results.")] = Path(
        "diagnosis"
    ),
    effect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            show_default="the catalogue and your own",
            help="Try only this effect. May be repeated.",
        ),
    ] = None,
    effects: OwnEffects = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Say which effect a simulation misses, where it acts, and how far the gap shrinks with it.

    Writes diagnosis.json, model.json and report.html into DIR, all or none.
    """
    with _told(debug), _listening(quiet) as listener:
        from rigsight.workflow.diagnose import run_diagnose
        from rigsight.workflow.own_effects import named, own_effects

        own = own_effects(effects or [], listener=listener)
        diagnosis = run_diagnose(
            campaign,
            out,
            effects=named(effect or [], own),
            own_effects=own,
            seed=seed,
            n_jobs=jobs,
            listener=listener,
            command=_command_line(),
        )
    if not quiet:
        _show(diagnosis)
        _show_files(out)


@app.command()
def identify(
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN", help="A campaign.toml or the folder that holds one.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the results.")] = Path(
        "identification"
    ),
    method: Annotated[
        str,
        typer.Option(
            "--method",
            metavar="NAME",
            help="How frequency responses are estimated: local_rational, local_polynomial, h1 or thesis.",
        ),
    ] = "local_rational",
    resolution: Annotated[
        float | None,
        typer.Option(
            "--resolution",
            metavar="RAD_S",
            show_default="what each record gives",
            help="Width in frequency wished for: of a local band, or between averaged frequencies.",
        ),
    ] = None,
    jobs: Jobs = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Fit frequency responses and steps: the parameters of the linear rig, by record and for all together.

    Writes identification.json, model.json, a Bode plot for each record and amplitudes.svg into DIR, all or none.
    """
    with _told(debug), _listening(quiet) as listener:
        from rigsight.workflow.identify import run_identify

        identification = run_identify(
            campaign, out, method=method, resolution=resolution, n_jobs=jobs, listener=listener
        )
    if not quiet:
        from rigsight.report import identification_summary

        _print(identification_summary(identification))
        for line in ("", f"Results: {out / 'identification.json'}", f"Model:   {out / 'model.json'}"):
            typer.echo(line)


@app.command()
def discover(
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN", help="A campaign.toml or the folder that holds one.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the results.")] = Path(
        "discovery"
    ),
    method: Annotated[
        str,
        typer.Option(
            "--method",
            metavar="NAME",
            help="discrepancy: regress what the rig's own terms leave; full: the whole acceleration.",
        ),
    ] = "discrepancy",
    pointwise: Annotated[
        bool, typer.Option("--pointwise", help="Regress sample by sample instead of in the weak form.")
    ] = False,
    one_by_one: Annotated[
        bool, typer.Option("--one-by-one", help="Discover on each estimation record alone as well.")
    ] = False,
    seed: Seed = 0,
    jobs: Jobs = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Find the governing equations behind the records by sparse regression and free-run simulation.

    Writes discovery.json, model.json and discovery.svg into DIR, all or none.
    """
    with _told(debug), _listening(quiet) as listener:
        from rigsight.workflow.discover import run_discover

        found = run_discover(
            campaign,
            out,
            method=method,
            pointwise=pointwise,
            one_by_one=one_by_one,
            seed=seed,
            n_jobs=jobs,
            listener=listener,
        )
    if not quiet:
        from rigsight.report.discovery import discovery_summary

        _print(discovery_summary(found))
        for line in ("", f"Results: {out / 'discovery.json'}", f"Model:   {out / 'model.json'}"):
            typer.echo(line)


@app.command()
def compare(
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN", help="A campaign.toml or the folder that holds one.")
    ],
    model: Annotated[
        list[str],
        typer.Argument(
            metavar="MODEL...",
            help="Each a model.json, the folder that holds one, or a published set such as hysteresis_r; NAME=MODEL names it.",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the results.")] = Path(
        "comparison"
    ),
    method: Annotated[
        str,
        typer.Option(
            "--method",
            metavar="NAME",
            help="How all frequency responses are estimated: local_rational, local_polynomial, h1 or thesis.",
        ),
    ] = "local_rational",
    step_seconds: Annotated[
        float, typer.Option(metavar="SECONDS", help="How long a step is compared, from its begin on.")
    ] = 4.0,
    jobs: Jobs = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Score models on all records: frequency responses, steps and free runs, each beside its noise floor.

    Writes comparison.json, comparison.csv, comparison.html and figures into DIR, all or none.
    """
    with _told(debug), _listening(quiet) as listener:
        from rigsight.workflow.compare import run_compare

        comparison = run_compare(
            campaign,
            model,
            out,
            method=method,
            step_seconds=step_seconds,
            n_jobs=jobs,
            listener=listener,
            command=_command_line(),
        )
    if not quiet:
        from rigsight.report import comparison_summary

        _print(comparison_summary(comparison))
        for line in ("", f"Page:  {out / 'comparison.html'}", f"Table: {out / 'comparison.csv'}"):
            typer.echo(line)


@app.command()
def simulate(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL", help="A model.json or the folder that holds one.")
    ],
    record: Annotated[
        Path,
        typer.Argument(metavar="RECORD", help="A CSV file with time and input; other columns are ignored."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            show_default="RECORD_simulated.csv in this folder",
            help="CSV file to write.",
        ),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            "--column",
            metavar="SIGNAL=COLUMN",
            help="Where a signal stands: u=current or u=2. May be repeated.",
        ),
    ] = None,
    initial_state: Annotated[
        str | None,
        typer.Option(
            metavar="STATE=VALUE,...|estimated",
            show_default="rest at the first input",
            help="States that start elsewhere (psi=0.01,w=0), or 'estimated' from the outputs in the record.",
        ),
    ] = None,
    effects: OwnEffects = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Predict the outputs of a model for the input of a record.

    Writes a CSV with time, input and simulated outputs in SI units (t,u,psi,y; axis: t,u,x; element: t,x,force).
    """
    file = out or Path(f"{record.stem}_simulated.csv")
    with _told(debug), _listening(quiet):
        from rigsight.workflow.own_effects import own_effects
        from rigsight.workflow.simulate import run_simulate

        simulated = run_simulate(
            model,
            record,
            file,
            columns=_columns(column or []),
            initial_state=_states(initial_state),
            own_effects=own_effects(effects or [], check=False),
        )
    if not quiet:
        typer.echo(f"{simulated.n_samples} samples simulated: {file}")


@app.command()
def vary(
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL",
            help="A model.json, the folder that holds one, or a published set such as hysteresis_r.",
        ),
    ],
    parameter: Annotated[
        list[str],
        typer.Option(metavar="NAME", help="The parameter to vary. May be repeated: one picture each."),
    ],
    low: Annotated[
        float | None,
        typer.Option("--from", metavar="VALUE", show_default="half the model's", help="First value."),
    ] = None,
    high: Annotated[
        float | None,
        typer.Option("--to", metavar="VALUE", show_default="twice the model's", help="Last value."),
    ] = None,
    steps: Annotated[int, typer.Option(help="Number of values.")] = 5,
    amplitude: Annotated[float, typer.Option(help="Amplitude of the sweep, in the unit of the input.")] = 1.0,
    lowest: Annotated[
        float | None,
        typer.Option(
            metavar="OMEGA", show_default="1/12 of the natural frequency", help="Begin of the band [rad/s]."
        ),
    ] = None,
    highest: Annotated[
        float | None,
        typer.Option(metavar="OMEGA", show_default="6 times the natural frequency", help="Its end [rad/s]."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the results.")] = Path(
        "vary"
    ),
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Show how the frequency response of a model changes with a parameter.

    Writes vary.svg, vary.png (vary_NAME.svg, ... where several parameters are named) and vary.json into DIR, all or none.
    """
    with _told(debug), _listening(quiet) as listener:
        from rigsight.workflow.vary import run_vary, table_text

        if (lowest is None) != (highest is None):
            raise InputError("--lowest and --highest go together: give both, or neither.")
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
            listener=listener,
        )
    if not quiet:
        for variation in variations:
            typer.echo(table_text(variation) + "\n")
        typer.echo(f"Pictures and numbers: {out}")


@app.command()
def blind(
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Its folder.")] = Path("blind"),
    trials: Annotated[
        int | None, typer.Option(min=1, show_default="one of every cell", help="Number of trials.")
    ] = None,
    trial: Annotated[
        list[int] | None,
        typer.Option(metavar="NUMBER", show_default="all", help="Run only this trial. May be repeated."),
    ] = None,
    design: Annotated[
        Literal["small", "standard"], typer.Option(help="Which list of cells is drawn from.")
    ] = "standard",
    seed: Seed = 0,
    jobs: Jobs = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Diagnose drawn rigs whose effect is withheld, and score the verdicts by sealed keys.

    Writes campaigns, keys and results into DIR as they are finished, and the score into DIR/blind.json. Started again, it goes
    on where it was interrupted.
    """
    with _told(debug, "the same command goes on from here"), _listening(quiet) as listener:
        from rigsight.workflow.blind import run_blind

        content = run_blind(
            out,
            design=design,
            trials=trials,
            seed=seed,
            only=trial or (),
            n_jobs=jobs,
            listener=listener,
            command=_command_line(),
        )
    if not quiet:
        from rigsight.report.blind import BlindSummary

        _print(BlindSummary(content))
        typer.echo(f"\nScore: {out / 'blind.json'}")


@app.command(name="effects")
def list_effects(
    effects: OwnEffects = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """List the effects that a diagnosis tries, and check effects of your own before they compete.

    A file's effects are simulated and fitted: exit code 2 and the reason if one does not keep what an effect promises.
    """
    with _told(debug), _listening(quiet) as listener:
        from rigsight.effects import CATALOGUE
        from rigsight.workflow.own_effects import equation_text, own_effects

        own = own_effects(effects or [], listener=listener)
        if quiet:
            return
        for effect in (*CATALOGUE, *own):
            typer.echo(f"{effect.name:28}{effect.place.value:18}{equation_text(effect)}")
        if own:
            typer.echo(f"\nYour own, checked: {', '.join(effect.name for effect in own)}")


def _columns(given: list[str]) -> dict[str, ColumnMapping]:
    from rigsight.records import ColumnMapping

    columns = {}
    for text in given:
        signal, sign, name = text.partition("=")
        if not (signal and sign and name):
            raise InputError(
                f"--column '{text}' cannot be read; write SIGNAL=COLUMN, for instance u=current."
            )
        columns[signal.strip()] = ColumnMapping(int(name) if name.isascii() and name.isdigit() else name)
    return columns


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


def _command_line() -> str:
    return shlex.join(["rigsight", *sys.argv[1:]])


def _show(diagnosis: Diagnosis) -> None:
    from rigsight.report.terminal import summary

    _print(summary(diagnosis))


def _print(renderable: RenderableType) -> None:
    from rich.console import Console

    Console(highlight=False).print(renderable)


def _show_files(out: Path, *more: str) -> None:
    for line in ("", f"Report: {out / 'report.html'}", f"Model:  {out / 'model.json'}", *more):
        typer.echo(line)


def _listening(quiet: bool) -> contextlib.AbstractContextManager[Listener]:
    from rigsight.workflow.progress_display import listening

    return listening(quiet)
