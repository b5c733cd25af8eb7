"""The work of `rigsight init`: measured files -> a commented `campaign.toml`; the model of a robot -> also its rig file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rigsight.errors import InputError, check_option, readable
from rigsight.records import Role
from rigsight.records.channel_table import open_measurement
from rigsight.records.formats.known import MEASURED_SUFFIXES
from rigsight.rigs import RIGS, Rig
from rigsight.robots import FreeRun, RigDraft, free_run, read_robot, rig_text, with_gears
from rigsight.workflow.campaign.campaign_file import MOST_RECORDS
from rigsight.workflow.campaign.record_proposal import (
    BLANK,
    KNOWN_HOLD,
    Proposal,
    propose,
    quoted,
)
from rigsight.workflow.own.own_rigs import own_rigs
from rigsight.workflow.run.progress import Listener, Stage, silent
from rigsight.workflow.run.results import write_together

CAMPAIGN_FILE = "campaign.toml"

_SCORED = re.compile(r"valid|verif|test|check|pruef|prüf|score", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Draft:
    """A written campaign."""

    path: Path  # the file
    model: str  # the rig that matches the channels best
    records: tuple[str, ...]  # files taken as records
    left_out: tuple[tuple[str, str], ...]  # other measured files, and why they were not taken
    n_blanks: int  # values that are left to be filled in
    others: tuple[str, ...] = ()  # rigs that it was chosen from, where it is a guess


@dataclass(frozen=True, eq=False)
class ModelDraft:
    """A written rig file."""

    path: Path  # the rig file
    draft: RigDraft  # its contents, and what it leaves out
    run: FreeRun  # its free run compared with MuJoCo
    campaign: Draft | None  # the campaign in the same folder; None if the folder contains no records yet


def run_init(
    folder: str | Path,
    *,
    model: str | None = None,
    rig_files: Iterable[Path] = (),
    values: Mapping[str, float] | None = None,
    listener: Listener = silent,
) -> Draft:
    """Write a `campaign.toml` for the measured files of a folder, and a copy of a rig file from elsewhere beside it."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; name the folder of the measured files.")
    path = folder / CAMPAIGN_FILE
    _refuse(path, path.exists() or path.is_symlink())
    own = own_rigs(rig_files)
    known = {rig.name: rig for rig in (*own.values(), *RIGS.values())}
    rigs = tuple((own or known).values())
    if model is not None:
        rigs = (known[check_option("--model", model, known)],)
    files = measured_files(folder)
    if len(files) > MOST_RECORDS:
        raise InputError(
            f"{folder} contains {len(files)} measured files; a campaign can have at most {MOST_RECORDS}."
        )
    proposals, left_out = proposed_records(files, rigs, listener)
    if not proposals:
        reasons = "".join(f"\n{name}: {reason}" for name, reason in left_out[:5])
        raise InputError(
            f"{folder} contains no usable measured file ({', '.join(MEASURED_SUFFIXES)}).{reasons}"
        )
    rig = proposals[0].guess.rig
    others = () if len(rigs) == 1 else tuple(name for name in known if name != rig.name)
    source = {own_rig.name: file for file, own_rig in own.items()}.get(rig.name)
    beside = {} if source is None else _copied(folder, source)
    inside = source and (folder / source.name if beside else source)
    text, n_blanks = campaign_text(folder, rig, inside, others, values, proposals, left_out)
    write_together(folder, {**beside, CAMPAIGN_FILE: text}, "Free disk space there, or get write permission.")
    return Draft(
        path, rig.name, tuple(proposal.file for proposal in proposals), tuple(left_out), n_blanks, others
    )


def run_init_from_mjcf(
    folder: str | Path,
    model_file: str | Path,
    *,
    gears: Mapping[str, float] | None = None,
    locked: Mapping[str, float] | None = None,
    as_it_is: bool = False,
    listener: Listener = silent,
) -> ModelDraft:
    """Write the rig file of a MuJoCo model or URDF, and a campaign if its folder holds measured files."""
    folder, source = Path(folder), Path(model_file)
    robot = read_robot(source, gears, locked, as_it_is=as_it_is)
    draft = robot.draft
    stage = Stage(f"Equations of {len(draft.tables['coordinates'])} coordinates", 2, listener)
    rig = draft.rig
    stage.finished("derived")
    path = folder / f"{rig.name}.toml"
    text = rig_text(draft, source.name, folder)
    # When records have been added, the same command writes the campaign.
    _refuse(path, path.exists() and path.read_text(encoding="utf-8", errors="replace") != text)
    campaign_file = folder / CAMPAIGN_FILE
    _refuse(campaign_file, campaign_file.exists() or campaign_file.is_symlink())
    run = free_run(with_gears(robot.spec, draft), draft)
    stage.finished("compared with MuJoCo")
    write_together(folder, {path.name: text}, "Free disk space there, or get write permission.")
    campaign = None
    if measured_files(folder):
        campaign = run_init(folder, model=rig.name, rig_files=[path], values=draft.values, listener=listener)
    return ModelDraft(path, draft, run, campaign)


def _refuse(path: Path, exists: bool) -> None:
    if exists:
        raise InputError(f"{path} exists already and is not overwritten; remove it, or edit it by hand.")


def _copied(folder: Path, file: Path) -> dict[str, str]:
    """Return the copy of the rig file for the folder of the campaign; empty if the rig file is already there."""
    if file.resolve().is_relative_to(folder.resolve()):
        return {}
    text, copy = file.read_text(encoding="utf-8"), folder / file.name
    if copy.exists() and copy.read_text(encoding="utf-8", errors="replace") != text:
        raise InputError(
            f"{copy} differs from {file}, which would be copied there. Give {copy.name} of that folder with --rigs, or remove it."
        )
    return {file.name: text}


def measured_files(folder: Path) -> list[Path]:
    """Return the files of a folder that may hold records, in the order of their names."""
    return sorted(
        file
        for file in folder.iterdir()
        if file.is_file() and not file.name.startswith(".") and file.suffix.lower() in MEASURED_SUFFIXES
    )


def proposed_records(
    files: Sequence[Path], rigs: Sequence[Rig], listener: Listener = silent
) -> tuple[list[Proposal], list[tuple[str, str]]]:
    """Return every file as a record of one rig, and the files that cannot be records with the reason."""
    found: dict[Path, Proposal] = {}
    left_out = []
    stage = Stage("Reading files", len(files), listener)
    for file in files:
        try:
            with open_measurement(file) as opened:
                if not opened.channels:
                    raise InputError(f"{file.name} contains no signal over time.")
                found[file] = propose(file, opened, rigs)
        except InputError as error:
            left_out.append((file.name, str(error).removeprefix(file.name).lstrip(":, ")))
        stage.finished(file.name)
    if len(rigs) > 1 and found:
        fitting = Counter(
            one.guess.rig.name for one in found.values() if one.guess.open_questions == 0
        ) or Counter(one.guess.rig.name for one in found.values())
        model = fitting.most_common(1)[0][0]
        chosen = [rig for rig in rigs if rig.name == model]
        for file, one in found.items():
            if one.guess.rig.name != model:
                with open_measurement(file) as opened:
                    found[file] = propose(file, opened, chosen)
    proposals = []
    for file, one in found.items():
        signals = one.guess.signals
        if not any(guess.is_clear or guess.candidates for guess in signals) and len(found) > 1:
            left_out.append((file.name, "no channel looks like a signal of the rig"))
        else:
            proposals.append(one)
    used = proposals or list(found.values())
    return [part for one in used for part in one.each_stretch], left_out if proposals or not found else []


def campaign_text(
    folder: Path,
    rig: Rig,
    file: Path | None,
    others: Sequence[str],
    values: Mapping[str, float] | None,
    proposals: Sequence[Proposal],
    left_out: Sequence[tuple[str, str]],
) -> tuple[str, int]:
    """Return the campaign as text, and the number of blanks in it."""
    open_constants = [constant for constant in rig.constants if constant.default is None]
    n_blanks = len(open_constants) + sum(proposal.n_blanks for proposal in proposals)
    lines = [
        "# Written by rigsight init from the files of this folder. Comments (#) mark guessed values: check them.",
    ]
    if n_blanks:
        times = "once" if n_blanks == 1 else f"{n_blanks} times"
        lines.append(f"# Replace each {BLANK} ({times}): these values could not be guessed.")
    lines += [
        "",
        f"title = {quoted(readable(folder.resolve().name))}",
        "",
        *_rig_lines(folder, rig, file, others),
    ]
    if rig.constants and (values is None or open_constants):
        lines += ["", "[rig.constants]"]
        for constant in rig.constants:
            assumed = "" if constant.default is None else "assumed, check: "
            about = f"# {assumed}{constant.description} [{constant.unit}]"
            lines.append(
                f"{constant.name} = {BLANK if constant.default is None else repr(constant.default)}  {about}"
            )
    lines += [
        "",
        "[rig.parameters]  # values of the given simulation; parameters left as comments are identified from the records",
    ]
    known = values or {}
    lines += [
        f"{one.name} = {known[one.name]!r}  # {one.description} [{one.unit}]"
        if one.name in known
        else f"# {one.name} =    # {one.description} [{one.unit}]"
        for one in rig.parameters
    ]
    for proposal, (role, remark) in zip(proposals, _roles(proposals), strict=True):
        held = "" if values is None else KNOWN_HOLD
        lines += ["", proposal.toml(role, remark, held).rstrip("\n")]
    if left_out:
        lines += ["", "# Not used:"]
        lines += [f"# {name}: {' '.join(_printable(reason).split())}" for name, reason in left_out]
    return "\n".join(_printable(line) for text in lines for line in text.split("\n")) + "\n", n_blanks


def _roles(proposals: Sequence[Proposal]) -> list[tuple[Role, str]]:
    """Return the role of every record with a remark: validation by name, or else the last."""
    if len(proposals) == 1:
        return [
            ("estimation", "measure a second record for validation: errors of fitted records are too small")
        ]
    scored = [bool(_SCORED.search(Path(proposal.file).stem)) for proposal in proposals]
    if any(scored) and not all(scored):
        remark = "guessed from the file name; check"
    else:
        scored = [proposal is proposals[-1] for proposal in proposals]
        remark = "not fitted, only scored; guessed, choose any of the records"
    return [("validation", remark) if is_scored else ("estimation", "") for is_scored in scored]


def _rig_lines(folder: Path, rig: Rig, file: Path | None, others: Sequence[str]) -> list[str]:
    """Return the lines that name the rig; `others` are the other possible rigs if it was guessed."""
    remark = f"# {rig.summary}"
    if others:
        remark = (
            f"# guessed from the channels: {rig.summary} Others: {', '.join(others)} (init --model); or a rig file of your own: "
            'file = "..." instead (rigsight rigs NAME prints one to start from)'
        )
    bodies = rig.mechanism.bodies
    simulator = [] if bodies is None else [f'simulator = "{bodies.kind}"  # simulates the bodies']
    if file is None:
        return ["[rig]", f'model = "{rig.name}"  {remark}', *simulator]
    inside = file.resolve().relative_to(folder.resolve()).as_posix()
    return ["[rig]", f"file = {quoted(inside)}  {remark}", *simulator]


def _printable(text: str) -> str:
    """Return a line without the characters that TOML forbids in comments."""
    return "".join(sign if sign == "\t" or sign.isprintable() else " " for sign in text)
