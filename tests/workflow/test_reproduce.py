"""A report is repeated from the inputs it names, and only from these."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from html import escape
from pathlib import Path

import pytest

from rigsight.errors import InputError
from rigsight.workflow.reproduce import read_origin, run_reproduce, sealed

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a report whose results are known, beside its campaign."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "campaign.toml").write_text("[rig]\nmodel = 'axis'\n")
    (folder / "out").mkdir()
    return folder


def report(
    made: Path,
    command: str = "rigsight diagnose campaign.toml -o out --seed 3",
    results: object = {"verdict": "effect", "probability": 0.9},
) -> Path:
    digest = hashlib.sha256((made / "campaign.toml").read_bytes()).hexdigest()
    origin = {
        "command": command,
        "ran_in": "..",
        "campaign": "../campaign.toml",
        "versions": {"rigsight": "0.0"},
        "inputs": {"campaign.toml": digest},
        "results": results,
    }
    page = made / "out/report.html"
    page.write_text(
        f'<html><head><meta name="rigsight-origin" content="{escape(json.dumps(origin))}"></head></html>'
    )
    return page


def answering(probability: float, asked: list[list[str]]) -> Callable[..., None]:
    def run(arguments: list[str], folder: Path) -> None:
        asked.append(arguments)
        out = folder / arguments[arguments.index("--out") + 1]
        out.mkdir(exist_ok=True)
        (out / "diagnosis.json").write_text(json.dumps({"verdict": "effect", "probability": probability}))

    return run


def test_the_command_of_the_report_runs_again_with_another_folder(made: Path, tmp_path: Path) -> None:
    asked: list[list[str]] = []
    found = run_reproduce(report(made), tmp_path / "again", answering(0.9, asked))
    assert found.is_same
    assert asked == [["diagnose", "campaign.toml", "--seed", "3", "--out", str(tmp_path / "again")]]
    assert found.versions["rigsight"][0] == "0.0"


def test_another_result_is_a_difference(made: Path, tmp_path: Path) -> None:
    found = run_reproduce(report(made), tmp_path / "again", answering(0.8, []))
    assert [(one.key, one.reported, one.found) for one in found.differences] == [("probability", 0.9, 0.8)]
    assert json.loads((tmp_path / "again/reproduction.json").read_text())["same"] is False


def test_a_parameter_is_the_same_within_its_standard_error(made: Path, tmp_path: Path) -> None:
    def diagnosed(value: float) -> Callable[..., None]:
        model = {"effects": ["play"], "where": ["x"], "parameters": {"k": {"value": value, "std": 0.1}}}
        content = {"verdict": "effect", "effects": ["play"], "where": ["x"], "candidates": [model]}
        return lambda arguments, folder: (
            (tmp_path / "again").mkdir(exist_ok=True),
            (tmp_path / "again/diagnosis.json").write_text(json.dumps(content)),
        )

    results = {"verdict": "effect", "parameters": {"k": {"value": 5.0, "std": 0.1}}}
    page = report(made, results=results)
    assert run_reproduce(page, tmp_path / "again", diagnosed(5.0001)).is_same
    differences = run_reproduce(page, tmp_path / "again", diagnosed(5.01)).differences
    assert [(one.key, one.reported, one.found) for one in differences] == [("parameters.k", 5.0, 5.01)]


def test_a_page_that_was_changed_by_hand_is_known(made: Path, tmp_path: Path) -> None:
    page = report(made)
    found = run_reproduce(page, tmp_path / "again", answering(0.9, []))
    assert (found.page_is_as_written, found.is_same) == (None, True)
    page.write_text(
        sealed(page.read_text().replace("<head>", '<head><meta name="rigsight-page" content="">'))
    )
    found = run_reproduce(page, tmp_path / "again", answering(0.9, []))
    assert (found.page_is_as_written, found.is_same) == (True, True)
    page.write_text(page.read_text().replace("</html>", "quadratic damping</html>"))
    found = run_reproduce(page, tmp_path / "again", answering(0.9, []))
    assert (found.page_is_as_written, found.is_same, found.differences) == (False, False, ())


def test_with_a_changed_input_nothing_runs(made: Path, tmp_path: Path) -> None:
    moved = tmp_path / "moved"
    page = report(made)
    shutil.copytree(made, moved)
    (moved / "campaign.toml").write_text("changed")
    asked: list[list[str]] = []
    found = run_reproduce(moved / page.relative_to(made), tmp_path / "again", answering(0.9, asked))
    assert found.changed_inputs == ("campaign.toml",)
    assert found.folder == str(moved)
    assert not found.is_same
    assert not asked


@pytest.mark.parametrize(
    "command", ["rigsight diagnose . --effects own.py", "rigsight diagnose . --simulator=own.py:f", "rm -r /"]
)
def test_a_report_runs_nothing_else(made: Path, tmp_path: Path, command: str) -> None:
    with pytest.raises(InputError):
        run_reproduce(report(made, command), tmp_path / "again", answering(0.9, []))


def test_a_page_that_is_no_report_is_refused(tmp_path: Path, run: Run) -> None:
    (tmp_path / "page.html").write_text("<html></html>")
    assert run("reproduce", tmp_path / "page.html", "-o", tmp_path / "again")[0] == 2
    assert run("reproduce", tmp_path / "none.html", "-o", tmp_path / "again")[0] == 2


def test_a_diagnosis_names_its_inputs(axis_campaign: Path, tmp_path: Path, run: Run) -> None:
    arguments = ("-o", tmp_path / "out", "--effect", "cubic_stiffness", "-j", "1", "--by", "A. Engineer")
    assert run("diagnose", axis_campaign, *arguments)[0] == 0
    page = (tmp_path / "out/report.html").read_text("utf-8")
    assert sealed(page) == page != sealed(page.replace("cubic", "dry"))
    made = read_origin(tmp_path / "out/report.html")
    assert made["results"]["parameters"].keys() >= {"m", "d", "k"}
    assert made["by"] == "A. Engineer"
    assert "campaign.toml" in made["inputs"]
    assert all(made["inputs"].values())
    assert made["results"]["effects"] == ["cubic_stiffness"]
