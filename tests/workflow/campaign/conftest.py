"""A campaign of two records."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from .campaign_text import HEAD, RECORDS, Lines


@pytest.fixture
def campaign(tmp_path: Path, write_csv: Callable[..., Path]) -> Callable[..., Path]:
    """Write a campaign of two records and return its folder."""

    def write(text: str = HEAD + RECORDS, change: Callable[[Lines], None] | None = None) -> Path:
        write_csv("sweep.csv", change=change)
        write_csv("step.csv", change=lambda lines: lines.pop())
        (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")
        return tmp_path

    return write
