"""What belongs together is asked for together; a score of parts is written where it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rigsight_bench.running.files import STORE_FILE
from rigsight_bench.running.store import TrialStore
from rigsight_bench.scoring import Outcome

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def part(tmp_path: Path, outcome_like: Callable[..., Outcome]) -> Path:
    folder = tmp_path / "part"
    folder.mkdir()
    with TrialStore(folder / STORE_FILE) as store:
        store.add([outcome_like()])
    return folder


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--campaigns", "a"], ["--keys is missing"]),
        (["--keys", "a"], ["--campaigns is missing"]),
        (["--merge", "a", "--rescore"], ["--merge and --rescore", "cannot be combined"]),
        (["--merge", "a", "--campaigns", "b", "--keys", "c"], ["--merge and --campaigns"]),
        (["--rescore", "--trial", "3"], ["--rescore runs no trial"]),
        (["--campaigns", "a", "--keys", "b", "--seed", "0"], ["--campaigns draws no rigs, so --seed"]),
        (
            ["--campaigns", "a", "--keys", "b", "--trials", "3", "--design", "standard"],
            ["so --trials and --design would"],
        ),
        (["--rescore", "--design", "standard"], ["--rescore draws no rigs, so --design"]),
        (["--merge", "a", "--trials", "3"], ["--merge draws no rigs, so --trials"]),
        (["--trial", "three"], ["--trial must be a number", "'three'", "--campaigns"]),
        (["--trial", "9999", "--design", "standard"], ["numbered from 0", "9999"]),
        (["--trial", "60", "--design", "laboratory"], ["numbered from 0 to 59", "60"]),
        (["--campaigns", "gone", "--keys", "gone"], ["not a folder", "--campaigns"]),
        (["--rescore"], ["does not contain a blind bench", "--out"]),
        (["--merge", "gone"], ["no scored trials", "--rescore"]),
    ],
)
def test_options_that_cannot_be_meant_are_refused(
    run: Run, tmp_path: Path, options: list[str], words: list[str]
) -> None:
    code, out, err = run("blind", "--out", tmp_path / "out", *options)
    assert (code, out) == (2, "")
    for word in words:
        assert word in err
    assert not (tmp_path / "out").exists()


def test_parts_are_merged_into_json_page_and_text(run: Run, tmp_path: Path, part: Path) -> None:
    text = tmp_path / "docs" / "blind.md"
    code, out, _ = run("blind", "--merge", part, "--out", tmp_path / "all", "--markdown", text)
    assert code == 0
    assert "1 of design standard, seed 1" in out
    assert sorted(file.name for file in (tmp_path / "all").iterdir()) == ["blind.html", "blind.json"]
    assert f"`rigsight blind --merge {part}" in text.read_text()
    assert str(text) in out


def test_a_text_that_cannot_be_written_is_told_before_any_work(run: Run, tmp_path: Path, part: Path) -> None:
    code, _, err = run("blind", "--merge", part, "--out", tmp_path / "all", "--markdown", tmp_path)
    assert code == 2
    assert "is a folder" in err
    assert not (tmp_path / "all").exists()
