"""Several benches add up to one score, in which no trial counts twice; a large one lists no more than it must."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from rigsight.errors import InputError
from rigsight_bench.running import score_files
from rigsight_bench.running.files import STORE_FILE
from rigsight_bench.running.score_files import Scored, merge, write_markdown, write_score
from rigsight_bench.running.store import TrialStore
from rigsight_bench.scoring import Outcome

Like = Callable[..., Outcome]


def bench(folder: Path, *outcomes: Outcome) -> Path:
    folder.mkdir()
    with TrialStore(folder / STORE_FILE) as store:
        store.add(outcomes)
    return folder


def test_parts_add_up_and_no_trial_counts_twice(
    tmp_path: Path, outcome_like: Like, wrong_outcome: Like
) -> None:
    first = bench(tmp_path / "a", outcome_like(trial="000"), wrong_outcome(trial="001"))
    second = bench(tmp_path / "b", outcome_like(trial="001"), outcome_like(trial="002"))
    other = bench(tmp_path / "c", outcome_like(trial="000", seed=2))
    content = merge([first, second, other], tmp_path / "all", "rigsight blind --merge ...")
    assert content["benches"] == [
        {"design": "standard", "seed": 1, "n_trials": 3},
        {"design": "standard", "seed": 2, "n_trials": 1},
    ]
    # Where two hold the same trial, the first has the word.
    assert [(w["seed"], w["trial"]) for w in content["wrong"]] == [(1, "001")]
    written = json.loads((tmp_path / "all" / "blind.json").read_text())
    assert written["goals"] == content["goals"]
    assert [t["trial"] for t in written["trials"]] == ["000", "001", "002", "000"]


def test_campaigns_of_one_name_from_two_labs_are_two_trials(tmp_path: Path, outcome_like: Like) -> None:
    labs = [
        bench(tmp_path / lab, outcome_like(design="external", seed=0, trial="axis", fingerprint=lab))
        for lab in ("a", "b")
    ]
    assert merge(labs, tmp_path / "all")["n_trials"] == 2


def test_a_wrong_trial_links_to_its_report_from_wherever_the_score_is(
    tmp_path: Path, wrong_outcome: Like
) -> None:
    part = bench(tmp_path / "a", wrong_outcome(trial="001"), wrong_outcome(trial="002"))
    report = part / "results" / "001" / "report.html"
    report.parent.mkdir(parents=True)
    report.write_text("a report")
    content = merge([part], tmp_path / "deep" / "all")
    links = [wrong["report"] for wrong in content["wrong"]]
    assert links == ["../../a/results/001/report.html", None]
    assert (tmp_path / "deep" / "all" / links[0]).resolve() == report


def test_a_large_score_keeps_its_figures_and_lists_wrong_trials_alone(
    tmp_path: Path, outcome_like: Like, wrong_outcome: Like, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(score_files, "MOST_LISTED", 3)
    outcomes = [outcome_like(trial=f"{n:03d}") for n in range(3)]
    few = write_score(tmp_path, [Scored(o, tmp_path) for o in outcomes], "x")
    assert len(few["trials"]) == 3
    more = [*outcomes, wrong_outcome(trial="003")]
    many = write_score(tmp_path, [Scored(o, tmp_path) for o in more], "x")
    assert many["trials"] is None
    assert [wrong["trial"] for wrong in many["wrong"]] == ["003"]
    assert many["goals"]["singles_right"]["total"] == 4


def test_a_bench_without_rows_says_how_it_gets_them(tmp_path: Path, outcome_like: Like) -> None:
    with pytest.raises(InputError, match=r"trials\.sqlite.*--rescore --out"):
        merge([tmp_path], tmp_path / "all")
    part = bench(tmp_path / "a", outcome_like())
    with pytest.raises(InputError, match="would overwrite"):
        merge([part], tmp_path / "b" / ".." / "a")


def test_a_score_is_written_as_text(tmp_path: Path, outcome_like: Like) -> None:
    content = merge([bench(tmp_path / "a", outcome_like())], tmp_path / "all")
    write_markdown(tmp_path / "docs" / "blind.md", content)
    assert (tmp_path / "docs" / "blind.md").read_text().startswith("# The blind bench\n")
