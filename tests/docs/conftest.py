"""What builds the documentation site lies beside the pages, outside the package."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

HOOKS = Path(__file__).parents[2] / "docs/hooks"


@pytest.fixture
def hook(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], ModuleType]]:
    """Import a module of docs/hooks as mkdocs does: its neighbors are found by their bare names."""
    monkeypatch.syspath_prepend(str(HOOKS))
    yield importlib.import_module
    for file in HOOKS.glob("*.py"):
        sys.modules.pop(file.stem, None)
