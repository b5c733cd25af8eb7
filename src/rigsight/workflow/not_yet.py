"""What can a command not take yet? It says so before anything runs, rather than leave something out."""

from __future__ import annotations

from collections.abc import Iterable

from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.rigs import RIGS, Rig, is_built_in_motion

_BUILT_IN_ONLY = frozenset({"discover"})
"""Commands that know the parameters of built-in rigs of one motion by their names; one that does not is taken out here."""
_SAME_CONSTANTS_ONLY = frozenset({"discover"})
"""Commands that read several records as if they were of one rig; one that tells them apart is taken out here."""


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
    if command in _BUILT_IN_ONLY and rig.has_one_motion and not is_built_in_motion(rig):
        listed = ", ".join(name for name, built_in in RIGS.items() if built_in.has_one_motion)
        raise InputError(
            f"'rigsight {command}' cannot take the rig '{rig.name}' of your own yet: of rigs of one motion it takes {listed}. "
            "If the equation is the same, write it in their words."
        )
    for record in records if command in _SAME_CONSTANTS_ONLY else ():
        if record.constants:
            listed = ", ".join(record.constants)
            raise InputError(
                f"'rigsight {command}' cannot take constants that differ from record to record yet, and record "
                f"'{record.name}' gives {listed}. Give them under [rig.constants], or leave the record out."
            )
