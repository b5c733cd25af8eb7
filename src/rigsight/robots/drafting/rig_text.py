"""The tables of a rig file -> its text, with omitted parts as comments at its head."""

from __future__ import annotations

import os
from pathlib import Path

from rigsight.errors import InputError
from rigsight.robots.drafting.draft import RigDraft


def rig_text(draft: RigDraft, source: str, folder: Path) -> str:
    """Return the text of a rig file."""
    try:
        import tomli_w
    except ImportError:
        raise InputError(
            "Writing a rig file needs tomli-w, which is not installed: pip install 'rigsight[mujoco]'."
        ) from None
    lines = [f"Written by rigsight init from {source}.", *draft.notes]
    if draft.left_out:
        lines += ["Not taken over:", *(f"- {what}" for what in draft.left_out)]
    head = "\n".join(f"# {line}" for line in "\n".join(lines).split("\n"))
    tables = dict(draft.tables)
    if draft.is_as_it_is:
        beside = Path(os.path.relpath(tables["simulator"]["file"], folder.resolve())).as_posix()
        tables["simulator"] = {**tables["simulator"], "file": beside}
    return f"{_printable(head)}\n\n{tomli_w.dumps(tables)}"


def _printable(text: str) -> str:
    """Return text without the signs that TOML forbids in comments."""
    return "".join(sign if sign in "\n\t" or sign.isprintable() else " " for sign in text)
