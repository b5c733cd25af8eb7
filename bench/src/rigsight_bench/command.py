"""The command ``rigsight blind``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from rigsight.cli.exit_codes import report_errors
from rigsight.cli.options import Debug, Jobs, Json, Quiet, Seed
from rigsight.cli.terminal import command_line, show, show_files, show_json
from rigsight.errors import InputError
from rigsight.workflow.run.progress import listening


def blind(
    context: typer.Context,
    folder: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FOLDER]",
            show_default=False,
            help="Folder with measured campaigns, for design measured and no other: every campaign*.toml in it or below it.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder of the bench.")] = Path(
        "blind"
    ),
    trials: Annotated[
        int | None, typer.Option(min=1, show_default="one per cell of the design", help="Number of trials.")
    ] = None,
    trial: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NUMBER|NAME",
            show_default="all",
            help="Run only this trial (drawn rigs), or only the campaign of this name. May be repeated.",
        ),
    ] = None,
    design: Annotated[
        Literal["standard", "laboratory", "handwritten", "measured"],
        typer.Option(
            help="Kinds of trials to draw. standard: effects of the catalogue on a running gear or an axis; laboratory: records "
            "with the imperfections of laboratory measurements (filters, feedback, stiction, ...), on several rigs; handwritten: "
            "plants with equations written by hand, independent of the catalogue; measured: a known cause is added to the "
            "records of a campaign in FOLDER."
        ),
    ] = "standard",
    seed: Seed = 0,
    campaigns: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            show_default="rigs are drawn",
            help="Diagnose existing campaigns instead of drawing rigs; each is a subfolder of DIR.",
        ),
    ] = None,
    keys: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            show_default="none",
            help="Folder with the key NAME.json of each campaign. Smallest key: "
            '{"kind": "single", "effects": ["backlash"]}.',
        ),
    ] = None,
    merge: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DIR",
            show_default="none",
            help="Run no trials; score the bench in DIR together with other benches (repeat this option).",
        ),
    ] = None,
    rescore: Annotated[
        bool, typer.Option("--rescore", help="Run no trials; score the diagnosed trials in --out again.")
    ] = False,
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="FILE", show_default="none", help="Also write the score as Markdown."),
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
    """Diagnose trials whose true effect is withheld, and score the verdicts against sealed keys.

    The rigs of the trials are drawn at random, or are those of measured campaigns to whose records a cause is added (--design
    measured FOLDER), or those of existing campaigns as they are (--campaigns, --keys). Each result is written
    into DIR when its trial is finished, the score into DIR/blind.json and DIR/blind.html. After an interruption, the same command
    continues with the remaining trials.
    """
    with report_errors(debug, "the same command continues from here"), listening(quiet) as listener:
        from rigsight.workflow.run.results import check_target
        from rigsight_bench import benches
        from rigsight_bench.running.score_files import merge as merged
        from rigsight_bench.running.score_files import write_markdown
        from rigsight_bench.trial_process import START

        drawing = [f"--{name}" for name in ("trials", "design", "seed") if _is_given(context, name)]
        _check_together(campaigns, keys, merge or [], rescore, trial or [], drawing)
        _check_folder(
            folder,
            design,
            "--merge" if merge else "--rescore" if rescore else "--campaigns" if campaigns else "",
        )
        running_in = [f"--{name}" for name in ("jobs", "cluster") if _is_given(context, name)]
        if merge and running_in:
            raise InputError(f"--merge runs no trials. Leave out {' and '.join(running_in)}.")
        if len(running_in) > 1:
            raise InputError(
                "The workers of a cluster determine how many trials run at once. Leave out --jobs."
            )
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
            content = benches.rescore(out, **running)
        elif campaigns is not None and keys is not None:
            content = benches.run_external(campaigns, keys, out, start=START, only=trial or (), **running)
        else:
            content = benches.run_blind(
                out,
                start=START,
                design=design,
                measured=folder,
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
        from rigsight_bench.report.terminal import BlindSummary

        show(BlindSummary(content))
        text = {"Text": markdown} if markdown is not None else {}
        show_files({"Page": out / "blind.html", "Score": out / "blind.json", **text})


def _is_given(context: typer.Context, name: str) -> bool:
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


def _check_together(
    campaigns: Path | None,
    keys: Path | None,
    merge: Sequence[Path],
    rescore: bool,
    trial: Sequence[str],
    drawing: Sequence[str],
) -> None:
    """Refuse options that exclude each other, or of which only one of two is given."""
    if (campaigns is None) != (keys is None):
        missing = "--keys" if keys is None else "--campaigns"
        raise InputError(f"--campaigns and --keys must be given together; {missing} is missing.")
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
        raise InputError(f"{' and '.join(asked)} cannot be combined. Give only one of them.")
    if trial and (merge or rescore):
        raise InputError(f"{asked[0]} runs no trials, so --trial has no effect. Leave it out.")
    if asked and drawing:
        listed, them = " and ".join(drawing), "it" if len(drawing) == 1 else "them"
        raise InputError(f"{asked[0]} draws no rigs, so {listed} would have no effect. Leave {them} out.")


def _check_folder(folder: Path | None, design: str, other: str) -> None:
    """Refuse a folder of measured campaigns with anything but its design, and its absence with that."""
    if folder is not None and (other or design != "measured"):
        use = other or f"Design {design}"
        raise InputError(
            f"{use} reads no folder of measured campaigns. Leave out {folder}, or write --design measured."
        )
    if folder is None and design == "measured" and not other:
        raise InputError(
            "Design measured adds causes to the records of measured campaigns. Name their folder: "
            "rigsight blind --design measured FOLDER"
        )


def _numbers(given: Sequence[str]) -> list[int]:
    for text in given:
        if not (text.isascii() and text.isdecimal()):
            raise InputError(
                f"--trial must be a number, got '{text}'. Names are allowed only with --campaigns and --keys."
            )
    return [int(text) for text in given]
