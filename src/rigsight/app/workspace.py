"""What may be written into the folder of a campaign, and under which name: uploads, edited text, files moved out of the way."""

from __future__ import annotations

import contextlib
import errno
import secrets
import shutil
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

from rigsight.errors import InputError, MachineError, readable, shown
from rigsight.records.formats.known import LARGEST_FILE
from rigsight.workflow.run.results import check_writable, write_together

OWN = ".rigsight-app"
"""Folder of the app inside that of the campaign: outputs of commands, text that is not saved yet, unfinished uploads."""
CAMPAIGN = "campaign.toml"
_DRAFT, _BEGUN_FROM = "draft.toml", "draft_begun_from.toml"
_REMOVED = "removed"
_UPLOADS = "uploads"
_LONGEST_NAME = 150
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of a disk on which nothing more fits."""


def opened(folder: Path) -> Path:
    """Return the absolute path of a folder in which the app can work; it is made where it is missing."""
    check_writable(folder, CAMPAIGN)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made: {error.strerror}. Name another folder.") from None
    # Left by a server that was killed during an upload.
    shutil.rmtree(folder / OWN / _UPLOADS, ignore_errors=True)
    return folder.resolve()


def safe_name(name: str) -> str:
    """Return the name under which an uploaded file is kept: the last part of its path, if that is a plain name."""
    last = name.replace("\\", "/").rpartition("/")[2].strip()
    if not last or last.startswith(".") or not last.isprintable() or ":" in last or len(last) > _LONGEST_NAME:
        raise InputError(
            f"A file cannot be kept as {shown(name)}. Give it a name of 1 to {_LONGEST_NAME} printable characters that "
            "does not begin with a dot."
        )
    return last


def inside(folder: Path, path: str) -> Path | None:
    """Return a file of a folder by its path there; None for what is no file, or lies elsewhere, also behind a link."""
    with contextlib.suppress(OSError, ValueError):
        file = (folder / path).resolve()
        if file.is_file() and file.is_relative_to(folder.resolve()):
            return file
    return None


async def receive(folder: Path, name: str, chunks: AsyncIterator[bytes], size: int) -> Path:
    """Write an upload of this announced size [B] chunk by chunk; the file is there once it is whole."""
    target = folder / safe_name(name)
    if target.exists() or target.is_symlink():
        raise InputError(
            f"{target.name} exists already and is not overwritten. Remove it first, or rename the new file."
        )
    if size > LARGEST_FILE:
        raise InputError(
            f"{target.name} has {size / 1e9:.1f} GB; uploads may have {LARGEST_FILE / 1e9:g} GB. Copy it into {folder} instead."
        )
    part = folder / OWN / _UPLOADS / f"{secrets.token_hex(8)}.part"
    try:
        part.parent.mkdir(parents=True, exist_ok=True)
        free = shutil.disk_usage(part.parent).free
        if size > free:
            raise OSError(errno.ENOSPC, "too little space")
        written = 0
        with part.open("xb") as file:
            async for chunk in chunks:
                written += file.write(chunk)
                if written > LARGEST_FILE:
                    raise OSError(errno.EFBIG, "the upload is larger than announced")
        if written != size:
            raise InputError(f"{target.name} arrived incomplete: {written} of {size} bytes. Upload it again.")
        if target.exists():
            raise InputError(
                f"{target.name} was uploaded in another window meanwhile; it is not overwritten."
            )
        part.replace(target)
    except OSError as error:
        reason = "the disk is full" if error.errno in FULL else error.strerror
        raise MachineError(
            f"{target.name} was not kept: {reason}. Free disk space, then upload it again."
        ) from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
    return target


def set_aside(folder: Path, name: str) -> Path:
    """Move a file of the folder into its subfolder for what was removed, beside earlier files of that name."""
    return _moved(folder / safe_name(name), folder / _REMOVED)


def campaign_text(folder: Path) -> str | None:
    """Return the text of the campaign as it is saved; None if there is none."""
    return _text(folder / CAMPAIGN)


@dataclass(frozen=True)
class Draft:
    """Text of the campaign that was typed and not saved, and the saved text that it began from."""

    text: str
    begun_from: str | None


def find_draft(folder: Path) -> Draft | None:
    """Return the draft of a folder, if there is one."""
    text = _text(folder / OWN / _DRAFT)
    return None if text is None else Draft(text, _text(folder / OWN / _BEGUN_FROM))


def keep_draft(folder: Path, draft: Draft, last: Draft | None) -> None:
    """Keep text that is being typed, so that a reload loses none; a draft other than the `last` of this page is moved aside."""
    on_disk = find_draft(folder)
    if on_disk is not None and on_disk not in (last, draft):
        _moved(folder / OWN / _DRAFT, folder / _REMOVED)
    if draft.text == draft.begun_from:
        _forget_draft(folder)
    else:
        texts = {_DRAFT: draft.text, _BEGUN_FROM: draft.begun_from or ""}
        write_together(folder / OWN, texts, "Free disk space; the text on the page is not kept yet.")


def save_campaign(folder: Path, draft: Draft) -> Path | None:
    """Save the campaign; what was saved elsewhere since the draft was begun is moved aside, and its new place returned."""
    on_disk = campaign_text(folder)
    aside = None
    if on_disk is not None and on_disk not in (draft.begun_from, draft.text):
        aside = set_aside(folder, CAMPAIGN)
    write_together(folder, {CAMPAIGN: draft.text}, "Free disk space; the text is not saved yet.")
    _forget_draft(folder)
    return aside


def _forget_draft(folder: Path) -> None:
    for name in (_DRAFT, _BEGUN_FROM):
        (folder / OWN / name).unlink(missing_ok=True)


def _moved(source: Path, removed: Path) -> Path:
    number = 1
    while removed.exists() and not removed.is_dir():  # a file that was given this name
        number += 1
        removed = removed.with_name(f"{_REMOVED}-{number}")
    number = 1
    while (target := removed / f"{source.stem}{'' if number == 1 else f'-{number}'}{source.suffix}").exists():
        number += 1
    try:
        removed.mkdir(exist_ok=True)
        source.rename(target)
    except OSError as error:
        raise InputError(f"{readable(source.name)} cannot be moved to {removed}: {error.strerror}.") from None
    return target


def _text(file: Path) -> str | None:
    try:
        with file.open(encoding="utf-8", errors="replace", newline="") as stream:
            return stream.read()
    except OSError:
        return None
