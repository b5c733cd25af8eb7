"""Which commands cannot take every rig yet? They say so before anything runs, rather than leave a signal or a place out."""

from __future__ import annotations

from collections.abc import Iterable

from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.rigs import Rig

ONE_MOTION_ONLY = frozenset({"compare", "diagnose", "discover", "export", "identify", "vary"})
"""Commands written for rigs of one motion; a command that takes every rig is taken out here."""


def check_takes(command: str, rig: Rig, records: Iterable[Record] = ()) -> None:
    """Refuse what a command would ignore.

    Parameters
    ----------
    command
        Its name.
    rig
        What it is asked to work on.
    records
        Records of this rig.

    Raises
    ------
    InputError
        If it was written for rigs of one motion and this one has more, or records have constants of their own.
    """
    if command not in ONE_MOTION_ONLY:
        return
    if not rig.has_one_motion:
        raise InputError(
            f"'rigsight {command}' cannot take the rig '{rig.name}' yet: it works on rigs of one motion, with one joint, one "
            "input and no feedback. 'rigsight simulate' runs every rig."
        )
    for record in records:
        if record.constants:
            listed = ", ".join(record.constants)
            raise InputError(
                f"'rigsight {command}' cannot take constants that differ from record to record yet, and record "
                f"'{record.name}' gives {listed}. Give them under [rig.constants], or leave the record out."
            )
