"""A diagnosis sees the campaign and nothing else; a bench that is stopped goes on where it was."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.blind import Trial, draw_trial, n_trials, subject_of
from rigsight.errors import InputError, RigsightError
from rigsight.records import Record
from rigsight.workflow import blind, blind_trial
from rigsight.workflow.blind import run_blind
from rigsight.workflow.blind_files import RUN_FILE, BenchFolder, read_json
from rigsight.workflow.blind_trial import diagnose_trial, score_trial
from rigsight.workflow.campaign import read_campaign

SEED = 4711
NUMBER = 617
"""A number that would be seen wherever it leaks."""

WATCHED = """
import os, sys
forbidden = {forbidden!r}
def watch(event, arguments):
    for argument in arguments:
        if isinstance(argument, (str, bytes, os.PathLike)) and forbidden in os.fsdecode(os.path.abspath(os.fsdecode(argument))):
            os._exit(77)
sys.addaudithook(watch)
"""
TELLS_ALL = """
import json, os, sys
os.makedirs("results")
files = [os.path.join(folder, file) for folder, _, names in os.walk(".") for file in names]
seen = {"environment": dict(os.environ), "arguments": sys.argv, "folder": os.getcwd(), "files": sorted(files)}
json.dump(seen, open("results/seen.json", "w"))
"""


@pytest.fixture(scope="module")
def trial() -> Trial:
    number = next(t for t in range(n_trials("small")) if subject_of("small", SEED, t).kind == "none")
    return draw_trial("small", SEED, number)


@pytest.fixture
def bench(tmp_path: Path, trial: Trial) -> BenchFolder:
    folder = BenchFolder(tmp_path / "secret_bench")
    folder.settle("small", SEED)
    folder.write_trial(NUMBER, trial)
    return folder


def shortened(folder: BenchFolder, n_samples: int = 1500) -> None:
    """Leave the sweep of the middle amplitude and the first seconds of the step: enough to see no gap."""
    place = folder.campaign(NUMBER)
    text = (place / "campaign.toml").read_text()
    head, *records = text.split("[[records]]")
    kept = [r for r in records if "record_2" in r or "record_4" in r]
    (place / "campaign.toml").write_text(head + "".join("[[records]]" + r for r in kept))
    for name in ("record_2", "record_4"):
        lines = (place / f"{name}.csv").read_text().splitlines()
        (place / f"{name}.csv").write_text("\n".join(lines[: n_samples + 1]) + "\n")


def test_a_process_that_diagnoses_is_told_nothing_but_the_campaign(bench: BenchFolder) -> None:
    diagnose_trial(bench, NUMBER, start=("-c", TELLS_ALL))
    seen = read_json(bench.result(NUMBER) / "seen.json")
    text = json.dumps(seen)
    for secret in (str(SEED), str(NUMBER), "secret_bench", "keys", "small"):
        assert secret not in text
    assert [Path(file).name for file in seen["files"]] == [
        "campaign.toml",
        *(f"record_{i}.csv" for i in range(1, 7)),
    ]


@pytest.mark.slow
def test_a_diagnosis_runs_with_every_way_to_the_bench_barred(bench: BenchFolder) -> None:
    shortened(bench)
    watch = WATCHED.format(forbidden=str(bench.path))
    diagnose_trial(bench, NUMBER, start=("-c", watch + "from rigsight.cli import main; main()"))
    assert read_json(bench.result(NUMBER) / RUN_FILE)["message"] == ""
    assert read_json(bench.result(NUMBER) / "diagnosis.json")["verdict"] in (
        "none",
        "parameters",
        "unknown",
        "effect",
    )
    assert score_trial(bench, NUMBER).kind == "none"


def test_the_bar_would_have_been_noticed(bench: BenchFolder) -> None:
    peek = WATCHED.format(forbidden=str(bench.path)) + f"open({str(bench.key(NUMBER))!r})"
    with pytest.raises(RigsightError, match="77"):
        diagnose_trial(bench, NUMBER, start=("-c", peek))
    assert not bench.diagnosed(NUMBER)


def test_a_campaign_reads_as_it_was_drawn_and_withheld_records_stay_with_the_key(
    bench: BenchFolder, trial: Trial
) -> None:
    campaign = read_campaign(bench.campaign(NUMBER))
    assert campaign.parameters == trial.given
    for read, drawn in zip(campaign.records, trial.records, strict=True):
        assert (read.name, read.role, read.kind, read.hold) == (
            drawn.name,
            drawn.role,
            drawn.kind,
            drawn.hold,
        )
        assert np.allclose(read["u"], drawn["u"], rtol=1e-9, atol=0.0)
    campaign_files = {file.name for file in bench.campaign(NUMBER).iterdir()}
    assert not any("withheld" in name for name in campaign_files)
    assert all(bench.withheld(NUMBER, record.name).is_file() for record in trial.withheld)


def test_files_of_two_trials_differ_in_numbers_only(tmp_path: Path, trial: Trial) -> None:
    def bent(record: Record) -> Record:
        return record.with_signals(**{name: -3e-4 * samples**3 for name, samples in record.signals.items()})

    other = replace(
        trial,
        records=tuple(map(bent, trial.records)),
        withheld=tuple(map(bent, trial.withheld)),
        key={**trial.key, "kind": "single", "effects": ["backlash"], "values": {"g": 1e-3}},
    )
    folder = BenchFolder(tmp_path)
    folder.write_trial(1, trial)
    folder.write_trial(2, other)
    shapes = []
    for number in (1, 2):
        files = sorted(folder.campaign(number).iterdir())
        toml = (folder.campaign(number) / "campaign.toml").read_text()
        rows = [file.read_text().splitlines() for file in files if file.suffix == ".csv"]
        widths = {len(field.lstrip("-")) for lines in rows for row in lines[1:] for field in row.split(",")}
        shapes.append(([f.name for f in files], toml, [(lines[0], len(lines)) for lines in rows], widths))
    assert shapes[0] == shapes[1]
    assert len(shapes[0][3]) == 1


def test_a_bench_goes_on_where_it_was_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: Counter[int] = Counter()

    def make(folder: BenchFolder, design: str, seed: int, number: int) -> None:
        if not folder.drawn(number):
            done[number] += 1
            folder.key(number).write_text(json.dumps({**KEY, "trial": number}))

    def diagnose(folder: BenchFolder, number: int) -> None:
        if number == 2 and done[2] == 1:
            done[2] += 1
            raise RigsightError("killed")
        target = folder.result(number)
        target.mkdir(parents=True)
        (target / RUN_FILE).write_text(json.dumps({"seconds": 1.0, "message": "it failed"}))

    monkeypatch.setattr(blind, "make_trial", make)
    monkeypatch.setattr(blind, "diagnose_trial", diagnose)
    with pytest.raises(RigsightError, match="killed"):
        run_blind(tmp_path / "b", design="small", trials=4, seed=1, n_jobs=1)
    content = run_blind(tmp_path / "b", design="small", trials=4, seed=1, n_jobs=1)
    assert [t["trial"] for t in content["trials"]] == [0, 1, 2, 3]
    assert (done[0], done[1], done[3]) == (1, 1, 1)
    assert content["trials"][0]["verdict"] == "failed"
    assert [w["trial"] for w in content["wrong"]] == [0, 1, 2, 3]


KEY: dict[str, Any] = {
    "kind": "none", "effects": [], "where": [], "rig": "axis", "noise": "low", "gap": 1.0, "noise_floor": {}, "withheld": {},
}  # fmt: skip


def test_a_folder_of_another_bench_and_a_number_out_of_range_are_told(tmp_path: Path) -> None:
    BenchFolder(tmp_path).settle("small", 1)
    with pytest.raises(InputError, match="seed 1"):
        run_blind(tmp_path, design="small", seed=2)
    with pytest.raises(InputError, match="numbered"):
        run_blind(tmp_path / "other", design="small", trials=3, only=[3])


def test_a_failed_diagnosis_is_kept_with_its_reason(bench: BenchFolder) -> None:
    diagnose_trial(bench, NUMBER, start=("-c", "import sys; sys.exit('rigsight: no good')"))
    found = score_trial(bench, NUMBER)
    assert (found.verdict, found.right, found.message) == ("failed", False, "rigsight: no good")


def test_what_diagnosing_needs_is_all_that_it_gets(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIGSIGHT_SECRET", "backlash")
    assert "RIGSIGHT_SECRET" not in blind_trial._environment()
