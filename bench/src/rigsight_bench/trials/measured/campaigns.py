"""Measured campaigns below a folder, with their base equations."""

from __future__ import annotations

from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from rigsight.campaign import Campaign
from rigsight.errors import InputError, RigsightError
from rigsight.workflow.campaign.campaign_file import read_campaign_table
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight_bench.trials.measured.base import Base, base_of
from rigsight_bench.trials.measured.spots import Spot, spots

_PATTERN = "campaign*.toml"


def campaign_files(folder: Path) -> list[Path]:
    """Return the campaign files below a folder, relative to it and in order.

    Parameters
    ----------
    folder
        The folder.

    Raises
    ------
    InputError
        If it is none, or holds no campaign.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder. Name the folder with the measured campaigns.")
    found = sorted(path.relative_to(folder) for path in folder.rglob(_PATTERN) if path.is_file())
    if not found:
        raise InputError(f"There is no {_PATTERN} in {folder} or below it.")
    return found


def digest_of(path: Path) -> str:
    """Return a hash of a campaign file and of the files beside and below it: another content is another trial."""
    found = sha256(path.read_bytes())
    for file in sorted(f for f in path.parent.rglob("*") if f.is_file()):
        found.update(file.name.encode())
        found.update(file.read_bytes())
    return found.hexdigest()[:16]


@lru_cache(maxsize=64)
def measured_base(path: Path) -> Base | str:
    """Return the base equations of a campaign, or why it cannot be used.

    Parameters
    ----------
    path
        Its file.
    """
    try:
        campaign = read_campaign(path)
        if campaign.rig.mechanism.bodies is not None:
            return "another program simulates its bodies"
        return base_of(campaign)
    except RigsightError as error:
        return str(error)


@lru_cache(maxsize=64)
def measured_spots(path: Path) -> tuple[Spot, ...]:
    """Return what can be added to the records of a campaign; nothing if it cannot be used.

    Parameters
    ----------
    path
        Its file.
    """
    base = measured_base(path)
    return () if isinstance(base, str) else spots(base)


def rig_file_text(campaign: Campaign) -> str | None:
    """Return the text of the rig file of a campaign; None for a built-in rig."""
    assert campaign.path is not None
    table, _ = read_campaign_table(campaign.path)
    if table.rig.file is None:
        return None
    return (campaign.path.parent / table.rig.file).read_text(encoding="utf-8-sig")
