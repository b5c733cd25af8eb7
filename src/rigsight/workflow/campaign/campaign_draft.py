"""Draft a `campaign.toml` from the measured files of a folder."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from rigsight.errors import InputError, readable
from rigsight.records import Role
from rigsight.records.channel_summary import open_measurement
from rigsight.records.formats.known import BY_SUFFIX
from rigsight.rigs import Rig
from rigsight.workflow.campaign.record_proposal import (
    ASSUMED_HOLD,
    BLANK,
    KNOWN_HOLD,
    Proposal,
    propose,
    quoted,
)

MEASURED_SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm", *BY_SUFFIX)
_SCORED = re.compile(r"valid|verif|test|check|pruef|prüf|score", re.IGNORECASE)


def measured_files(folder: Path) -> list[Path]:
    """Return the files of a folder that may hold records, in the order of their names."""
    return sorted(
        file
        for file in folder.iterdir()
        if file.is_file() and not file.name.startswith(".") and file.suffix.lower() in MEASURED_SUFFIXES
    )


def proposed_records(
    files: Sequence[Path], rigs: Sequence[Rig]
) -> tuple[list[Proposal], list[tuple[str, str]]]:
    """Return every file as a record of one rig, and the files that cannot be records with the reason."""
    found: dict[Path, Proposal] = {}
    left_out = []
    for file in files:
        try:
            with open_measurement(file) as opened:
                if not opened.channels:
                    raise InputError(f"{file.name} contains no signal over time.")
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
        lines.append(f"# Replace each {BLANK} ({_times(n_blanks)}): these values could not be guessed.")
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
        held = ASSUMED_HOLD if values is None else KNOWN_HOLD
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
        return [
            ("validation", "guessed from the file name; check") if named else ("estimation", "")
            for named in scored
        ]
    last = len(proposals) - 1
    return [
        ("validation", "not fitted, only scored; guessed, choose any of the records")
        if i == last
        else ("estimation", "")
        for i in range(len(proposals))
    ]


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


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _printable(text: str) -> str:
    """Return a line without the characters that TOML forbids in comments."""
    return "".join(sign if sign == "\t" or sign.isprintable() else " " for sign in text)
