"""A diagnosis sees the campaign and nothing else; a bench that is stopped goes on where it was."""

from __future__ import annotations

import errno
import json
import os
import shutil
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.errors import InputError, MachineError, RigsightError
from rigsight.records import Record
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight_bench import benches
from rigsight_bench.benches import rescore, run_blind
from rigsight_bench.running.files import RUN_FILE, STORE_FILE, BenchFolder, read_json, trial_name
from rigsight_bench.running.scoring import score_trial
from rigsight_bench.running.trial import _environment, diagnose_trial
from rigsight_bench.scoring import Outcome
from rigsight_bench.trial_process import START
from rigsight_bench.trials import Trial, n_trials
from rigsight_bench.trials.standard.subjects import standard_subject_of

pytestmark = pytest.mark.slow

SEED = 4711
NAME = "617"
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
seen = {"environment": dict(os.environ), "arguments": sys.argv, "folder": os.getcwd(), "files": sorted(files),
        "oldest": min(map(os.path.getmtime, files))}
json.dump(seen, open("results/seen.json", "w"))
"""


@pytest.fixture(scope="module")
def trial(drawn: Callable[[int, int], Trial]) -> Trial:
    return drawn(
        SEED, next(t for t in range(n_trials("standard")) if standard_subject_of(SEED, t).kind == "none")
    )


@pytest.fixture
def bench(tmp_path: Path, trial: Trial) -> BenchFolder:
    folder = BenchFolder(tmp_path / "secret_bench")
    folder.settle("standard", SEED)
    folder.write_trial(NAME, trial)
    return folder


# The step comes after five seconds.
KEPT_SAMPLES = {"record_2": 600, "record_4": 1150}


def shortened(folder: BenchFolder) -> None:
    """Leave the first seconds of the sweep of the middle amplitude and of the step: enough to see no gap."""
    place = folder.campaign(NAME)
    text = (place / "campaign.toml").read_text()
    head, *records = text.split("[[records]]")
    kept = [r for r in records if any(name in r for name in KEPT_SAMPLES)]
    (place / "campaign.toml").write_text(head + "".join("[[records]]" + r for r in kept))
    for name, n_samples in KEPT_SAMPLES.items():
        lines = (place / f"{name}.csv").read_text().splitlines()
        (place / f"{name}.csv").write_text("\n".join(lines[: n_samples + 1]) + "\n")


@pytest.mark.slow
def test_a_process_that_diagnoses_is_told_nothing_but_the_campaign(bench: BenchFolder) -> None:
    drawn = time.time() - 3600.0
    os.utime(bench.campaign(NAME) / "record_1.csv", (drawn, drawn))
    diagnose_trial(bench, NAME, start=("-c", TELLS_ALL))
    seen = read_json(bench.result(NAME) / "seen.json")
    text = json.dumps(seen)
    for secret in (str(SEED), NAME, "secret_bench", "keys", "standard"):
        assert secret not in text
    assert [Path(file).name for file in seen["files"]] == [
        "campaign.toml",
        *(f"record_{i}.csv" for i in range(1, 7)),
    ]
    assert seen["oldest"] > drawn + 1800.0, "times of files tell how long the trial took to draw"


@pytest.mark.slow
def test_a_diagnosis_runs_with_every_way_to_the_bench_barred(bench: BenchFolder) -> None:
    shortened(bench)
    watch = WATCHED.format(forbidden=str(bench.path))
    diagnose_trial(bench, NAME, start=("-c", watch + "from rigsight.cli import main; main()"))
    assert read_json(bench.result(NAME) / RUN_FILE)["message"] == ""
    assert read_json(bench.result(NAME) / "diagnosis.json")["verdict"] in (
        "none",
        "parameters",
        "unknown",
        "effect",
    )
    assert score_trial(bench, NAME).kind == "none"


def test_the_bar_would_have_been_noticed(bench: BenchFolder) -> None:
    peek = WATCHED.format(forbidden=str(bench.path)) + f"open({str(bench.key(NAME))!r})"
    with pytest.raises(RigsightError, match="77"):
        diagnose_trial(bench, NAME, start=("-c", peek))
    assert not bench.diagnosed(NAME)


def test_a_campaign_reads_as_it_was_drawn_and_withheld_records_stay_with_the_key(
    bench: BenchFolder, trial: Trial
) -> None:
    campaign = read_campaign(bench.campaign(NAME))
    assert campaign.parameters == trial.given
    for read, drawn in zip(campaign.records, trial.records, strict=True):
        assert (read.name, read.role, read.kind, read.hold) == (
            drawn.name,
            drawn.role,
            drawn.kind,
            drawn.hold,
        )
        assert np.allclose(read["u"], drawn["u"], rtol=1e-9, atol=0.0)
    campaign_files = {file.name for file in bench.campaign(NAME).iterdir()}
    assert not any("withheld" in name for name in campaign_files)
    for read, drawn in zip(bench.withheld_records(NAME, trial.rig), trial.withheld, strict=True):
        assert (read.name, read.kind, read.amplitude, read.hold) == (
            drawn.name,
            drawn.kind,
            drawn.amplitude,
            drawn.hold,
        )


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
    folder.write_trial("001", trial)
    folder.write_trial("002", other)
    shapes = []
    for name in ("001", "002"):
        files = sorted(folder.campaign(name).iterdir())
        toml = (folder.campaign(name) / "campaign.toml").read_text()
        rows = [file.read_text().splitlines() for file in files if file.suffix == ".csv"]
        widths = {len(field.lstrip("-")) for lines in rows for row in lines[1:] for field in row.split(",")}
        shapes.append(([f.name for f in files], toml, [(lines[0], len(lines)) for lines in rows], widths))
    assert shapes[0] == shapes[1]
    assert len(shapes[0][3]) == 1


KEY: dict[str, Any] = {
    "design": "standard", "seed": 1, "kind": "none", "effects": [], "where": [], "rig": "axis", "noise": "low", "gap": 1.0,
    "values": {}, "noise_floor": {}, "withheld": [],
}  # fmt: skip


class Steps:
    """Counts what is done to each trial, in place of the real steps; a trial may die at one of them, once."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.done: Counter[tuple[str, str]] = Counter()
        self.dies: set[tuple[str, str]] = set()
        for step in ("make", "diagnose", "score"):
            patch.setattr(benches, f"{step}_trial", getattr(self, step))

    def _count(self, step: str, name: str) -> None:
        if (step, name) in self.dies:
            self.dies.remove((step, name))
            raise RigsightError("killed")
        self.done[step, name] += 1

    def make(
        self, folder: BenchFolder, design: str, seed: int, number: int, measured: Path | None = None
    ) -> None:
        assert (measured is not None) == (design == "measured")
        name = trial_name(number)
        if not folder.drawn(name):
            self._count("make", name)
            folder.key(name).write_text(json.dumps(KEY))

    def diagnose(self, folder: BenchFolder, name: str, start: Sequence[str]) -> None:
        if not folder.diagnosed(name):
            self._count("diagnose", name)
            target = folder.result(name)
            target.mkdir(parents=True)
            (target / RUN_FILE).write_text(json.dumps({"seconds": 1.0, "message": "it failed"}))

    def score(self, folder: BenchFolder, name: str) -> Outcome:
        self._count("score", name)
        return score_trial(folder, name)


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> Steps:
    return Steps(monkeypatch)


@pytest.mark.parametrize("step", ["make", "diagnose", "score"])
def test_a_bench_goes_on_where_it_was_stopped(tmp_path: Path, steps: Steps, step: str) -> None:
    steps.dies.add((step, "002"))
    with pytest.raises(RigsightError, match="killed"):
        run_blind(tmp_path, start=START, design="standard", trials=4, seed=1, n_jobs=1)
    content = run_blind(tmp_path, start=START, design="standard", trials=4, seed=1, n_jobs=1)
    names = ["000", "001", "002", "003"]
    assert [t["trial"] for t in content["trials"]] == names
    assert steps.done == {(step, name): 1 for step in ("make", "diagnose", "score") for name in names}
    assert content["trials"][0]["verdict"] == "failed"
    assert [w["trial"] for w in content["wrong"]] == names


def test_a_trial_with_a_row_is_left_alone(tmp_path: Path, steps: Steps) -> None:
    run_blind(tmp_path, start=START, design="standard", trials=2, seed=1, n_jobs=1)
    before = steps.done.copy()
    # Neither key nor results are needed any more.
    shutil.rmtree(tmp_path / "results")
    told: list[str] = []
    content = run_blind(
        tmp_path,
        start=START,
        design="standard",
        trials=3,
        seed=1,
        n_jobs=1,
        listener=lambda step: told.append(step.detail),
    )
    assert content["n_trials"] == 3
    assert steps.done - before == {("make", "002"): 1, ("diagnose", "002"): 1, ("score", "002"): 1}
    assert "0 (done before)" in told


def test_one_trial_alone_is_added_to_the_score(tmp_path: Path, steps: Steps) -> None:
    run_blind(tmp_path, start=START, design="standard", seed=1, only=[7], n_jobs=1)
    content = run_blind(tmp_path, start=START, design="standard", seed=1, only=[5], n_jobs=1)
    assert [t["trial"] for t in content["trials"]] == ["005", "007"]
    assert content["wrong"][1]["again"] == "rigsight blind --design standard --seed 1 --trial 7 --out DIR"
    assert steps.done["diagnose", "007"] == 1


def test_rescoring_scores_what_is_diagnosed_and_runs_nothing(tmp_path: Path, steps: Steps) -> None:
    run_blind(tmp_path, start=START, design="standard", trials=2, seed=1, n_jobs=1)
    (tmp_path / "keys" / "001.json").write_text(json.dumps({**KEY, "noise": "high"}))
    (tmp_path / STORE_FILE).unlink()
    content = rescore(tmp_path, n_jobs=1)
    assert [t["noise"] for t in content["trials"]] == ["low", "high"]
    assert steps.done["diagnose", "001"] == 1
    assert rescore(tmp_path, n_jobs=1)["n_trials"] == 2
    with pytest.raises(InputError, match="does not contain a blind bench"):
        rescore(tmp_path / "elsewhere")


def test_a_folder_of_another_bench_and_a_number_out_of_range_are_told(tmp_path: Path) -> None:
    BenchFolder(tmp_path).settle("standard", 1)
    with pytest.raises(InputError, match="seed 1"):
        run_blind(tmp_path, start=START, design="standard", seed=2)
    with pytest.raises(InputError, match="numbered"):
        run_blind(tmp_path / "other", start=START, design="standard", trials=3, only=[3])


def test_a_failed_diagnosis_is_kept_with_its_reason(bench: BenchFolder) -> None:
    diagnose_trial(bench, NAME, start=("-c", "import sys; sys.exit('rigsight: no good')"))
    found = score_trial(bench, NAME)
    assert (found.verdict, found.right, found.message) == ("failed", False, "rigsight: no good")


@pytest.mark.slow
def test_a_machine_that_lets_no_diagnosis_work_is_no_result_of_a_trial(
    bench: BenchFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_the_way = tmp_path / "file"
    in_the_way.write_text("no folder", "utf-8")
    monkeypatch.setenv("RIGSIGHT_CACHE_DIR", str(in_the_way / "kernels"))
    with pytest.raises(MachineError, match="on this machine: rigsight: Cannot write compiled kernels"):
        diagnose_trial(bench, NAME, START)
    assert not bench.diagnosed(NAME)


def test_a_disk_without_room_for_results_says_so(bench: BenchFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("rigsight_bench.running.trial.shutil.copy", full)
    with pytest.raises(OSError, match="No space left") as raised:
        diagnose_trial(bench, NAME, start=("-c", ""))
    assert raised.value.errno == errno.ENOSPC
    assert not bench.diagnosed(NAME)


def test_what_diagnosing_needs_is_all_that_it_gets(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIGSIGHT_SECRET", "backlash")
    assert "RIGSIGHT_SECRET" not in _environment()
