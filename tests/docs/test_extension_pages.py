"""The pages on commands and on effects of one's own miss no command and no field."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

from rigsight.cli.application import COMMANDS
from rigsight.effects import Effect

DOCS = Path(__file__).parents[2] / "docs"


def test_the_table_of_commands_lists_every_command() -> None:
    text = (DOCS / "commands.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `rigsight (\w+)", text, re.MULTILINE)
    assert set(listed) == set(COMMANDS)


def test_the_page_on_own_effects_names_every_field_of_an_effect() -> None:
    text = (DOCS / "own_effects.md").read_text(encoding="utf-8")
    section = text.split("## What a declaration contains")[1].split("\n## ")[0]
    # A diagnosis says itself at which place it tries an effect.
    named = {field.name for field in fields(Effect)} - {"at"}
    assert {name for name in named if f"`{name}`" not in section} == set()
