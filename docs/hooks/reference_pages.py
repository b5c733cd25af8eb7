"""What does the reference of a public package say? mkdocstrings fills it from the docstrings."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE, BENCH = ROOT / "src/rigsight", ROOT / "bench/src/rigsight_bench"
PACKAGES = (
    "records",
    "parameters",
    "units",
    "errors",
    "json_data",
    "excitation",
    "metrics",
    "effects",
    "rigs",
    "simulate",
    "frequency",
    "robots",
    "simulators",
    "libraries",
    "identify",
    "campaign",
    "inverse",
    "discover",
    "compare",
    "diagnose",
    "check",
    "plan",
    "workflow",
    "plot",
    "report",
    "export",
    "api",
)
"""From what is measured to what is shown, as the packages lie above each other."""
COMMANDS = (
    "campaign.read_campaign",
    "diagnose",
    "check",
    "plan",
    "power",
    "identify",
    "discover",
    "compare",
    "simulate",
    "vary",
    "campaign.model_file",
)
"""Modules of `rigsight.workflow` that are public one by one: each command is a function of its own module."""


_AS_ENTRY = """\
    options:
      show_root_heading: true
      show_root_full_path: false
      show_root_toc_entry: true
      show_attribute_values: {values}
      heading_level: 2"""
_LONGEST_VALUE = 120
"""Letters of a constant's value that is shown: an alias of types is, a catalogue is not."""


def question(name: str, source: Path = SOURCE) -> str:
    """Return the first line of a package's docstring."""
    folder = source / name
    file = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
    return (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").partition("\n")[0]


def reference_index() -> str:
    """Return the page that lists the packages."""
    rows = [f"| [`rigsight.{name}`]({name}.md) | {question(name)} |" for name in PACKAGES]
    rows.append(f"| [`{BENCH.name}`]({BENCH.name}.md) | {question('', BENCH)} |")
    return "\n".join(
        [
            "# Python reference",
            "",
            "SI units everywhere; axis 0 of an array is time or frequency; angular frequency `omega` is in rad/s, sample time "
            "`dt` in s. A name is imported from its package: `from rigsight.records import Record`. Public names are those shown "
            "here; anything else may change without notice.",
            "",
            "| package | what it answers |",
            "|---|---|",
            *rows,
            "",
        ]
    )


def public_names(name: str, source: Path = SOURCE) -> dict[str, str]:
    """Return the names that a package offers, each with the path at which it is defined; none for a single module.

    The path matters: several functions are called as the module that holds them, and a name alone would be taken for that.
    """
    if not (source / name).is_dir():
        return {}
    tree = ast.parse((source / name / "__init__.py").read_text(encoding="utf-8"))
    found = {
        alias.asname: f"{node.module}.{alias.name}"
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname is not None
    }
    own = [
        node.target.id
        for node in tree.body
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    ]
    found |= {constant: f"{source.name}.{name}.{constant}" for constant in own}
    return dict(sorted(found.items(), key=lambda item: item[0].lower()))


def reference_page(name: str) -> str:
    """Return the page of a package."""
    names = public_names(name)
    if names:
        return "\n\n".join([f"# rigsight.{name}", question(name), *map(_entry, names.values()), ""])
    modules = (
        [f"rigsight.workflow.{command}" for command in COMMANDS]
        if name == "workflow"
        else [f"rigsight.{name}"]
    )
    head = [f"# rigsight.{name}", question(name)] if name == "workflow" else [f"# rigsight.{name}"]
    return "\n\n".join([*head, *(f"::: {module}" for module in modules), ""])


def bench_page() -> str:
    """Return the page of the package of the blind bench."""
    names = [path for name in ("trials", "scoring") for path in public_names(name, BENCH).values()]
    return "\n\n".join(
        [f"# {BENCH.name}", question("", BENCH), f"::: {BENCH.name}.benches", *map(_entry, names), ""]
    )


def _entry(path: str) -> str:
    return f"::: {path}\n{_AS_ENTRY.format(values=str(_is_short(path)).lower())}"


def _is_short(path: str) -> bool:
    """Return True if a name stands for a value that fits into a line."""
    module, _, name = path.rpartition(".")
    source = BENCH if module.startswith(BENCH.name) else SOURCE
    file = source.parent / Path(*module.split("."))
    file = file / "__init__.py" if file.is_dir() else file.with_suffix(".py")
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        if any(isinstance(target, ast.Name) and target.id == name for target in targets):
            return len(ast.unparse(node)) <= _LONGEST_VALUE
    return False
