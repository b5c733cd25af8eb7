"""What does ``rigsight blind`` accept, run and show?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import Debug, Jobs, Json, Quiet, Seed
from rigsight.cli.terminal import command_line, show, show_files, show_json
from rigsight.errors import InputError
from rigsight.workflow.run.progress_display import listening


def blind(
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Its folder.")] = Path("blind"),
    trials: Annotated[
        int | None, typer.Option(min=1, show_default="one of every cell", help="Number of trials.")
    ] = None,
    trial: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NUMBER|NAME",
            show_default="all",
            help="Run only this trial, or this campaign. May be repeated.",
        ),
    ] = None,
    design: Annotated[
        Literal["small", "standard", "joints", "rigs", "laboratory", "handwritten"],
        typer.Option(
            help="Which list of cells is drawn from; joints has the effects of servo and robot joints, rigs every built-in rig "
            "with effects at all its places, laboratory records as laboratories take them (filters, feedback, stiction, ...), "
            "handwritten plants that are composed from no declaration."
        ),
    ] = "standard",
    seed: Seed = 0,
    campaigns: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            show_default="rigs are drawn",
            help="Diagnose the campaigns in this folder, a folder each, instead of drawing rigs.",
        ),
    ] = None,
    keys: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            show_default="none",
            help='Keys of these campaigns, NAME.json each; the least is {"kind": "single", "effects": ["backlash"]}.',
        ),
    ] = None,
    merge: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DIR",
            show_default="none",
            help="Run nothing; score this bench with others as one. May be repeated.",
        ),
    ] = None,
    rescore: Annotated[
        bool, typer.Option("--rescore", help="Run nothing; score anew what is diagnosed in --out.")
    ] = False,
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="FILE", show_default="none", help="Write the score as Markdown as well."),
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            show_default="this machine",
            help="Run trials on the workers of a Dask scheduler, such as tcp://10.0.0.1:8786.",
        ),
    ] = None,
    jobs: Jobs = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Diagnose rigs whose effect is withheld, drawn ones or campaigns of your own, and score the verdicts by sealed keys.

    Writes results and one row per trial into DIR as they are finished, and the score into DIR/blind.json and DIR/blind.html.
    Started again, it goes on where it was interrupted.
    """
    with report_errors(debug, "the same command goes on from here"), listening(quiet) as listener:
        from rigsight.cli.trial_process import START
        from rigsight.workflow import blind as bench
        from rigsight.workflow.bench.score_files import merge as merged
        from rigsight.workflow.bench.score_files import write_markdown
        from rigsight.workflow.run.results import check_target

        _check_together(campaigns, keys, merge or [], rescore, trial or [])
        if markdown is not None:
            check_target(markdown)
        running: Mapping[str, Any] = {
            "n_jobs": jobs,
            "cluster": cluster,
            "listener": listener,
            "command": command_line(),
        }
        if merge:
            content = merged(merge, out, command_line())
        elif rescore:
            content = bench.rescore(out, **running)
        elif campaigns is not None and keys is not None:
            content = bench.run_external(campaigns, keys, out, start=START, only=trial or (), **running)
        else:
            content = bench.run_blind(
                out,
                start=START,
                design=design,
                trials=trials,
                seed=seed,
                only=_numbers(trial or []),
                **running,
            )
        if markdown is not None:
            write_markdown(markdown, content)
    if json:
        show_json(out / "blind.json")
    elif not quiet:
        from rigsight.report.blind import BlindSummary

        show(BlindSummary(content))
        text = {"Text": markdown} if markdown is not None else {}
        show_files({"Page": out / "blind.html", "Score": out / "blind.json", **text})


def _check_together(
    campaigns: Path | None, keys: Path | None, merge: Sequence[Path], rescore: bool, trial: Sequence[str]
) -> None:
    """Refuse options that ask for two things at once, or for half of one."""
    if (campaigns is None) != (keys is None):
        missing = "--keys" if keys is None else "--campaigns"
        raise InputError(f"--campaigns and --keys belong together; {missing} is missing.")
    asked = [
        name
        for name, given in (
            ("--merge", bool(merge)),
            ("--rescore", rescore),
            ("--campaigns", campaigns is not None),
        )
        if given
    ]
    if len(asked) > 1:
        raise InputError(f"{' and '.join(asked)} cannot be asked for together. Leave all but one out.")
    if trial and (merge or rescore):
        raise InputError(f"{asked[0]} runs no trial, so --trial says nothing there. Leave it out.")


def _numbers(given: Sequence[str]) -> list[int]:
    for text in given:
        if not (text.isascii() and text.isdecimal()):
            raise InputError(
                f"--trial must be a number, got '{text}'. A name goes with --campaigns and --keys."
            )
    return [int(text) for text in given]
