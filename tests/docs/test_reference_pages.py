"""The reference holds every public name of every package, under the path at which it is defined."""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

from rigsight.records import Record

SOURCE = Path(__file__).parents[2] / "src/rigsight"


def test_every_package_but_the_command_line_and_its_pages_has_a_page(
    hook: Callable[[str], ModuleType],
) -> None:
    packages = {
        path.stem
        for path in SOURCE.iterdir()
        if path.stem not in ("__init__", "__main__", "__pycache__", "py")
    }
    assert set(hook("reference_pages").PACKAGES) == packages - {"app", "cli"}


def test_the_bench_has_a_page(hook: Callable[[str], ModuleType]) -> None:
    reference = hook("reference_pages")
    entries = re.findall(r"^::: (\S+)$", reference.bench_page(), re.MULTILINE)
    assert {"rigsight_bench.benches", "rigsight_bench.scoring.trial_outcome.Outcome"} <= set(entries)
    assert all(pkgutil.resolve_name(entry) is not None for entry in entries)


def test_no_public_name_is_missed(hook: Callable[[str], ModuleType]) -> None:
    reference = hook("reference_pages")
    for name in reference.PACKAGES:
        page = reference.reference_page(name)
        entries = re.findall(r"^::: (\S+)$", page, re.MULTILINE)
        assert entries
        assert reference.question(name)
        content = vars(importlib.import_module(f"rigsight.{name}"))
        public = {
            own for own, value in content.items() if own[0] != "_" and not isinstance(value, ModuleType)
        }
        listed = {entry.rpartition(".")[2] for entry in entries}
        assert (
            public - {"annotations", "TYPE_CHECKING"} <= listed
            or name == "workflow"
            or not (SOURCE / name).is_dir()
        )
        for entry in entries:
            assert pkgutil.resolve_name(entry) is not None, entry
    assert f"::: {Record.__module__}.Record\n" in reference.reference_page("records")
