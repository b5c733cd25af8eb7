"""Which commands cannot take every rig yet? They say so before anything runs, rather than leave a signal or a place out."""

from __future__ import annotations

from collections.abc import Iterable

from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.rigs import RIGS, Rig

ONE_MOTION_ONLY = frozenset({"compare", "diagnose", "discover", "export", "vary"})
"""Commands written for rigs of one motion; a command that takes every rig is taken out here."""
BUILT_IN_ONLY = frozenset({"discover"})
"""Commands that know the parameters of built-in rigs by their names; one that does not is taken out here."""


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
        If it was written for other rigs, or records have constants of their own.
    """
    if command in ONE_MOTION_ONLY and not rig.has_one_motion:
        raise InputError(
            f"'rigsight {command}' cannot take the rig '{rig.name}' yet: it works on rigs of one motion, with one joint, one "
            "input and no feedback. 'rigsight simulate' runs every rig."
        )
    if command in BUILT_IN_ONLY and (rig.name not in RIGS or RIGS[rig.name].mechanism != rig.mechanism):
        raise InputError(
            f"'rigsight {command}' cannot take the rig '{rig.name}' of your own yet: it works on built-in rigs of one motion, "
            f"{_of_one_motion()}. Name one of them in [rig] if the equation is the same."
        )
    for record in records if command in ONE_MOTION_ONLY else ():
        if record.constants:
            listed = ", ".join(record.constants)
            raise InputError(
                f"'rigsight {command}' cannot take constants that differ from record to record yet, and record "
                f"'{record.name}' gives {listed}. Give them under [rig.constants], or leave the record out."
            )


def _of_one_motion() -> str:
    return ", ".join(name for name, rig in RIGS.items() if rig.has_one_motion)
