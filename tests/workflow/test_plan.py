"""`rigsight plan` from the files of a campaign: what it writes, whence it has the rivals, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., tuple[int, str, str]]

CANDIDATES: list[dict[str, Any]] = [
    {
        "effects": ["cubic_stiffness"],
        "where": ["spring"],
        "probability": 0.6,
        "parameters": {"k": {"value": 800.0}},
    },
    {"effects": ["power_law_stiffness"], "where": ["spring"], "probability": 0.2, "parameters": {}},
    {"effects": ["quadratic_damping"], "where": ["axis"], "probability": 0.1, "parameters": {}},
    {"effects": [], "where": [], "probability": 0.0, "parameters": {}},
]


def diagnosed(folder: Path, **changed: Any) -> Path:
    folder.mkdir()
    content = {"schema_version": 1, "rig": "axis", "candidates": CANDIDATES, **changed}
    (folder / "diagnosis.json").write_text(json.dumps(content))
    return folder


def test_a_plan_is_a_file_to_play_with_its_promise(axis_campaign: Path, tmp_path: Path, run: Run) -> None:
    out, results = tmp_path / "out", diagnosed(tmp_path / "results")
    asked = ["--diagnosis", results, "--seconds", "2.5", "--limit", "x=0.01", "-o", out, "--json"]
    code, stdout, stderr = run("plan", axis_campaign, *asked)
    assert code == 0, stderr
    assert sorted(path.name for path in out.iterdir()) == ["plan.csv", "plan.json", "plan.png", "plan.svg"]
    assert json.loads(stdout) == json.loads((out / "plan.json").read_text())
    rows = (out / "plan.csv").read_text().splitlines()
    assert (rows[0], len(rows)) == ("t,u", 501)
    # One of each family, the most probable first.
    assert [one["effects"] for one in json.loads(stdout)["rivals"]] == [
        "cubic_stiffness",
        "quadratic_damping",
    ]


REFUSED = {
    "no rivals": [],
    "rivals twice": ["--rivals", "cubic_stiffness,quadratic_damping", "--diagnosis", "results"],
    "one rival": ["--rivals", "cubic_stiffness"],
    "unknown rival": ["--rivals", "cubic_stiffness,friction"],
    "no diagnosis": ["--diagnosis", "nowhere"],
    "unknown limit": ["--diagnosis", "results", "--limit", "y=1"],
    "too short": ["--diagnosis", "results", "--seconds", "0.1"],
    "other rig": ["--diagnosis", "other"],
    "incomplete": ["--diagnosis", "incomplete"],
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_used_is_refused_before_anything_is_written(
    case: str, axis_campaign: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    diagnosed(tmp_path / "results")
    diagnosed(tmp_path / "other", rig="cart")
    diagnosed(tmp_path / "incomplete", candidates=[{"effects": []}])
    code, _, stderr = run("plan", axis_campaign, *REFUSED[case], "-o", "out", "-q")
    assert (code, (tmp_path / "out").exists()) == (2, False)
    assert stderr.startswith("rigsight: ")
    assert "Traceback" not in stderr


def test_the_file_of_a_rig_is_refused_as_one(tmp_path: Path, run: Run) -> None:
    file = resources.files("rigsight.rigs") / "files/axis.toml"
    code, _, stderr = run(
        "plan", file, "--rivals", "cubic_stiffness,quadratic_damping", "-o", tmp_path / "out"
    )
    assert code == 2
    assert len(stderr.splitlines()) <= 2
    assert "is the file of a rig" in stderr
