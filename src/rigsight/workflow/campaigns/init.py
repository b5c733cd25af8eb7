"""What `rigsight init` does: a folder of measured files -> a commented `campaign.toml`, to be checked and completed."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rigsight.errors import InputError, check_option
from rigsight.records import Role
from rigsight.records.formats.channel_file import SUFFIXES
from rigsight.records.formats.csv_channels import open_measurement
from rigsight.rigs import RIGS, Rig
from rigsight.workflow.campaigns.campaign_file import MOST_RECORDS
from rigsight.workflow.campaigns.record_proposal import BLANK, Proposal, propose, quoted
from rigsight.workflow.files.results import write_together
from rigsight.workflow.own.own_rigs import own_rigs

CAMPAIGN_FILE = "campaign.toml"
TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".asc")
_SCORED = re.compile(r"valid|verif|test|check|pruef|prüf|score", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Draft:
    """A campaign as it was written.

    Attributes
    ----------
    path
        The file.
    model
        The rig that the channels fit best.
    records
        Files taken as records.
    left_out
        Other measured files, and why they were not taken.
    n_blanks
        Values that are left to be filled in.
    others
        Rigs that it was chosen from, where it is a guess.
    """

    path: Path
    model: str
    records: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]
    n_blanks: int
    others: tuple[str, ...] = ()


def run_init(
    folder: str | Path,
    *,
    model: str | None = None,
    rig_files: Iterable[Path] = (),
    values: Mapping[str, float] | None = None,
) -> Draft:
    """Write a `campaign.toml` for the measured files of a folder, and a copy of a rig file from elsewhere beside it.

    Parameters
    ----------
    folder
        Folder with the files; those in folders below it are not looked at.
    model
        The rig; None for the one that the channels fit best.
    rig_files
        Rigs of the user's own, beside the built-in ones.
    values
        Parameters of the simulation in question, where they are known; constants then keep what the rig file says.

    Raises
    ------
    InputError
        If there is a campaign already, no file can be used, another file is in the way, or nothing can be written there.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder; name the folder that holds the measured files.")
    path = folder / CAMPAIGN_FILE
    if path.exists() or path.is_symlink():
        raise InputError(f"{path} exists already and is not overwritten; remove it, or edit it by hand.")
    own = own_rigs(rig_files)
    # A user's own come first: they win where a built-in one fits as well.
    known = {rig.name: rig for rig in (*own.values(), *RIGS.values())}
    rigs = tuple(known.values()) if model is None else (known[check_option("--model", model, known)],)
    files = measured_files(folder)
    if len(files) > MOST_RECORDS:
        raise InputError(
            f"{folder} holds {len(files)} measured files; a campaign has at most {MOST_RECORDS}."
        )
    proposals, left_out = _proposals(files, rigs)
    if not proposals:
        reasons = "".join(f"\n{name}: {reason}" for name, reason in left_out[:5])
        raise InputError(
            f"{folder} holds no measured file that can be used ({', '.join((*TEXT_SUFFIXES, *SUFFIXES))}).{reasons}"
        )
    rig = proposals[0].guess.rig
    others = () if model is not None else tuple(name for name in known if name != rig.name)
    source = {own_rig.name: file for file, own_rig in own.items()}.get(rig.name)
    beside = {} if source is None else _copied(folder, source)
    inside = source and (folder / source.name if beside else source)
    text, n_blanks = _text(folder, rig, _rig_lines(folder, rig, inside, others), values, proposals, left_out)
    write_together(folder, {**beside, CAMPAIGN_FILE: text}, "Make room or ask for the right to write there.")
    return Draft(
        path, rig.name, tuple(proposal.file for proposal in proposals), tuple(left_out), n_blanks, others
    )


def measured_files(folder: Path) -> list[Path]:
    """Return the files of a folder that may hold records, in the order of their names."""
    return sorted(
        file
        for file in folder.iterdir()
        if file.is_file()
        and not file.name.startswith(".")
        and file.suffix.lower() in (*SUFFIXES, *TEXT_SUFFIXES)
    )


def _proposals(files: Sequence[Path], rigs: Sequence[Rig]) -> tuple[list[Proposal], list[tuple[str, str]]]:
    """Return every file as a record of one rig, and the files that are none with the reason."""
    found: dict[Path, Proposal] = {}
    left_out = []
    for file in files:
        try:
            with open_measurement(file) as opened:
                if not opened.channels:
                    raise InputError(f"{file.name} holds no signal over time.")
                found[file] = propose(file, opened, rigs)
        except InputError as error:
            left_out.append((file.name, str(error).removeprefix(file.name).lstrip(":, ")))
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
    return proposals or list(found.values()), left_out if proposals or not found else []


def _roles(proposals: Sequence[Proposal]) -> list[tuple[Role, str]]:
    """Return the role of every record with a remark: validation by name, or else the last."""
    if len(proposals) == 1:
        return [
            ("estimation", "measure a second one for validation: only what was not fitted can be trusted")
        ]
    scored = [bool(_SCORED.search(Path(proposal.file).stem)) for proposal in proposals]
    if any(scored) and not all(scored):
        return [("validation", "by its name; check") if named else ("estimation", "") for named in scored]
    last = len(proposals) - 1
    return [
        ("validation", "never fitted, only scored; guessed, choose which")
        if i == last
        else ("estimation", "")
        for i in range(len(proposals))
    ]


def _text(
    folder: Path,
    rig: Rig,
    rig_lines: Sequence[str],
    values: Mapping[str, float] | None,
    proposals: Sequence[Proposal],
    left_out: Sequence[tuple[str, str]],
) -> tuple[str, int]:
    """Return the campaign as text, and the number of blanks in it."""
    open_constants = [constant for constant in rig.constants if constant.default is None]
    n_blanks = len(open_constants) + sum(proposal.n_blanks for proposal in proposals)
    lines = [
        "# Written by rigsight init from the files of this folder. What stands behind a # was guessed: check it.",
    ]
    if n_blanks:
        lines.append(f"# What could not be guessed reads {BLANK} ({_times(n_blanks)}): fill it in.")
    lines += ["", f"title = {quoted(folder.resolve().name)}", "", *rig_lines]
    if rig.constants and (values is None or open_constants):
        lines += ["", "[rig.constants]"]
        for constant in rig.constants:
            about = f"# {constant.description} [{constant.unit}]"
            lines.append(
                f"{constant.name} = {BLANK if constant.default is None else f'{constant.default:g}'}  {about}"
            )
    lines += [
        "",
        "[rig.parameters]  # the simulation in question; what stays a comment is identified from the records",
    ]
    known = values or {}
    lines += [
        f"{one.name} = {known[one.name]!r}  # {one.description} [{one.unit}]"
        if one.name in known
        else f"# {one.name} =    # {one.description} [{one.unit}]"
        for one in rig.parameters
    ]
    for proposal, (role, remark) in zip(proposals, _roles(proposals), strict=True):
        lines += ["", proposal.toml(role, remark).rstrip("\n")]
        if values is not None and rig.inputs:
            lines.append('hold = "zoh"  # a controller holds its command until the next one')
    if left_out:
        lines += ["", "# Not used:"]
        lines += [f"# {name}: {' '.join(_printable(reason).split())}" for name, reason in left_out]
    return "\n".join(_printable(line) for text in lines for line in text.split("\n")) + "\n", n_blanks


def _rig_lines(folder: Path, rig: Rig, file: Path | None, others: Sequence[str]) -> list[str]:
    """Return the lines that say which rig it is; `others` are the ones it was chosen from, if it is a guess."""
    remark = f"# {rig.summary}"
    if others:
        remark = (
            f"# guessed from the channels: {rig.summary} Others: {', '.join(others)} (init --model); or a rig file of your own: "
            'file = "..." instead (rigsight rigs NAME prints one to begin with)'
        )
    bodies = rig.mechanism.bodies
    simulator = [] if bodies is None else [f'simulator = "{bodies.kind}"  # it moves the bodies']
    if file is None:
        return ["[rig]", f'model = "{rig.name}"  {remark}', *simulator]
    inside = file.resolve().relative_to(folder.resolve()).as_posix()
    return ["[rig]", f"file = {quoted(inside)}  {remark}", *simulator]


def _copied(folder: Path, file: Path) -> dict[str, str]:
    """Return what to write beside a campaign so that it holds its rig file; nothing where that is inside already."""
    if file.resolve().is_relative_to(folder.resolve()):
        return {}
    text, copy = file.read_text(encoding="utf-8"), folder / file.name
    if copy.exists() and copy.read_text(encoding="utf-8", errors="replace") != text:
        raise InputError(
            f"{copy} differs from {file}, which would be copied there. Name the file in the folder with --rigs, or remove it."
        )
    return {file.name: text}


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _printable(text: str) -> str:
    """Return a line without the signs that TOML forbids in comments."""
    return "".join(sign if sign == "\t" or sign.isprintable() else " " for sign in text)
