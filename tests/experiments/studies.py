"""Modules of the studies, which are no package."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

_STUDIES = Path(__file__).parents[2] / "experiments"


def of_study(study: str, name: str) -> ModuleType:
    """Return a module of a study, with what it imports from its own folder."""
    sys.path.insert(0, str(_STUDIES / study))
    spec = importlib.util.spec_from_file_location(f"{study}_{name}", _STUDIES / study / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # A dataclass looks its module up there.
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.pop(0)
    return module
