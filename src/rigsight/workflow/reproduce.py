"""The work of `rigsight reproduce`: a report -> the same diagnosis run again, and whether it says the same.

A report carries its `origin`: the command, where it ran, its inputs, and what came out.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import shlex
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from rigsight.campaign import Campaign
from rigsight.diagnose.result import Diagnosis
from rigsight.errors import InputError
from rigsight.json_data import json_data
from rigsight.records import Record
from rigsight.workflow.run.results import DIAGNOSIS_FILE, check_writable, json_text, versions, write_together

SCHEMA_VERSION = 1
REPRODUCTION_FILE = "reproduction.json"
_NAME = "rigsight-origin"
_KEYS = {"command", "ran_in", "campaign", "versions", "inputs", "results"}
_EXECUTES = ("--effects", "--simulator")
"""Options that name a Python file, which a report that somebody sent must not run."""
_SAME = 1e-6
"""Relative difference of numbers that count as the same: another machine rounds differently."""
_SAME_ESTIMATE = 1e-2
"""Difference of parameters in standard errors that count as the same: another machine ends a fit elsewhere in the valley."""
RESULTS = ("verdict", "effects", "where", "probability", "gap", "families")
"""Keys of ``diagnosis.json`` that are compared, beside the parameters."""
_SEAL = re.compile(r'<meta name="rigsight-page" content="([0-9a-f]*)">')


@dataclass(frozen=True)
class Difference:
    """A result that is not what the report says."""

    key: str  # its place in ``diagnosis.json``, as in ``families.0.probability``
    reported: Any
    found: Any


@dataclass(frozen=True)
class Reproduction:
    """A diagnosis that was run again."""

    command: tuple[str, ...]  # the arguments behind ``rigsight``
    # Files that are not those of the report, or are missing; nothing was run then.
    changed_inputs: tuple[str, ...]
    folder: str  # in which the inputs were looked for
    page_is_as_written: bool | None  # None for a report of a version that did not keep its hash
    versions: Mapping[str, tuple[str, str]]  # package -> version of the report and here, where they differ
    differences: tuple[Difference, ...]

    @property
    def is_same(self) -> bool:
        """Whether the report can be trusted to say what its inputs say."""
        return not self.changed_inputs and not self.differences and self.page_is_as_written is not False

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``reproduction.json``."""
        return dict(json_data({"schema_version": SCHEMA_VERSION, "same": self.is_same, **vars(self)}))


def run_reproduce(report: Path, out: Path, run: Callable[[Sequence[str], Path], None]) -> Reproduction:
    """Run the diagnosis of a report again and compare; `run` runs rigsight with arguments in a folder, or raises InputError."""
    check_writable(out, REPRODUCTION_FILE)
    made = read_origin(report)
    command, folder = _command(report, made["command"]), report.resolve().parent
    campaign = (folder / made["campaign"]).resolve()
    now = digests(campaign.parent, made["inputs"])
    changed = tuple(name for name, digest in made["inputs"].items() if now[name] != digest)
    here = versions()
    apart = {name: (own, here.get(name, "not installed")) for name, own in made["versions"].items()}
    apart = {name: pair for name, pair in apart.items() if pair[0] != pair[1]}
    differences: tuple[Difference, ...] = ()
    if not changed:
        run([*command, "--out", str(out.resolve())], (folder / made["ran_in"]).resolve())
        found = json.loads((out / DIAGNOSIS_FILE).read_text("utf-8"))
        again = {**found, "parameters": _parameters(found)}
        differences = tuple(_differences("", made["results"], {key: again[key] for key in made["results"]}))
    text = report.read_text("utf-8")
    seal = _SEAL.search(text)
    as_written = None if seal is None else seal[1] == _hash(text)
    result = Reproduction(tuple(command), changed, str(campaign.parent), as_written, apart, differences)
    write_together(out, {REPRODUCTION_FILE: json_text(result.to_json())})
    return result


def read_origin(report: Path) -> dict[str, Any]:
    """Return what a report carries about itself."""
    try:
        text = report.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{report} cannot be read: {error}. Name the report.html of a diagnosis.") from None
    parser = _Origin()
    parser.feed(text)
    try:
        made = json.loads(parser.content)
    except ValueError:
        made = None
    if not isinstance(made, dict) or not made.keys() >= _KEYS:
        raise InputError(
            f"{report} does not say what it was made of: it is no report of 'rigsight diagnose', or one of a version before it "
            "could be repeated. Run the diagnosis again."
        )
    return made


class _Origin(HTMLParser):
    """Finds the entry of a page's head that says what it was made of."""

    content = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        own = dict(attrs)
        if tag == "meta" and own.get("name") == _NAME:
            self.content = own.get("content") or ""


def _command(report: Path, command: str) -> list[str]:
    """Return the arguments of a diagnosis without the folder of its results."""
    words = shlex.split(command)
    if words[:2] != ["rigsight", "diagnose"]:
        raise InputError(f"{report} was made by '{command}'; only 'rigsight diagnose' can be repeated.")
    for word in words:
        if word.split("=")[0] in _EXECUTES:
            raise InputError(
                f"{report} was made with {word}, which runs a Python file. Look at that file, then run the command yourself: "
                f"{command}"
            )
    kept, skips = list[str](), False
    for word in words[1:]:
        if skips:
            skips = False
        elif word in ("-o", "--out"):
            skips = True
        elif not word.startswith("--out=") and word not in ("--json", "--quiet", "-q"):
            kept.append(word)
    return kept


def _differences(key: str, reported: Any, found: Any) -> Iterator[Difference]:
    """Yield where two results differ by more than rounding."""
    if _is_estimate(reported) and _is_estimate(found):
        if not abs(reported["value"] - found["value"]) <= _SAME_ESTIMATE * reported["std"]:
            yield Difference(key, reported["value"], found["value"])
    elif isinstance(reported, dict) and isinstance(found, dict):
        for name in dict.fromkeys((*reported, *found)):
            yield from _differences(f"{key}.{name}".lstrip("."), reported.get(name), found.get(name))
    elif isinstance(reported, list) and isinstance(found, list) and len(reported) == len(found):
        for number, (one, other) in enumerate(zip(reported, found, strict=True)):
            yield from _differences(f"{key}.{number}", one, other)
    elif isinstance(reported, float | int) and isinstance(found, float | int):
        if not math.isclose(reported, found, rel_tol=_SAME, abs_tol=_SAME**2):
            yield Difference(key, reported, found)
    elif reported != found:
        yield Difference(key, reported, found)


def _is_estimate(one: Any) -> bool:
    return isinstance(one, dict) and all(isinstance(one.get(key), float | int) for key in ("value", "std"))


def origin(
    campaign: Campaign, diagnosis: Diagnosis, command: str, out: Path, by: str
) -> dict[str, Any] | None:
    """Return what a report in the folder `out`, made by somebody, carries about itself; None for a campaign without files."""
    if campaign.path is None:
        return None
    content = diagnosis.to_json()
    return {
        "command": command,
        # From the folder of the report: both may be moved together.
        "ran_in": os.path.relpath(Path.cwd(), out.resolve()),
        "campaign": os.path.relpath(campaign.path.resolve(), out.resolve()),
        "by": by,
        "versions": versions(),
        "inputs": digests(campaign.path.resolve().parent, _inputs(campaign.path, campaign.records)),
        "results": dict(
            json_data({**{key: content[key] for key in RESULTS}, "parameters": _parameters(content)})
        ),
    }


def _parameters(content: Mapping[str, Any]) -> Any:
    """Return the parameters of the model that a diagnosis chose, by name."""
    keys = ("effects", "where")
    chosen = (c for c in content.get("candidates", []) if all(c[key] == content[key] for key in keys))
    return next((one["parameters"] for one in chosen), None)


def sealed(page: str) -> str:
    """Return a report with the hash of its content, by which a page that was changed by hand is known."""
    return _SEAL.sub(lambda _: f'<meta name="rigsight-page" content="{_hash(page)}">', page, count=1)


def _hash(page: str) -> str:
    # Mail and version control may end lines in another way.
    text = "\n".join(_SEAL.sub("", page, count=1).splitlines())
    return hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()


def digests(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 of files of a folder by their name, empty for one that cannot be read."""
    found = {}
    for name in names:
        try:
            with (folder / name).open("rb") as file:
                found[name] = hashlib.file_digest(file, "sha256").hexdigest()
        except OSError:
            found[name] = ""
    return found


def _inputs(campaign: Path, records: Iterable[Record]) -> Iterator[str]:
    """Yield the files of a campaign, as they are called from its folder."""
    yield campaign.name
    rig_file = tomllib.loads(campaign.read_text("utf-8-sig")).get("rig", {}).get("file")
    if rig_file:
        yield rig_file
    sources = [record.source.resolve() for record in records if record.source is not None]
    yield from dict.fromkeys(os.path.relpath(source, campaign.resolve().parent) for source in sources)
