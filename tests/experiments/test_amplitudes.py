"""The study over amplitudes runs, takes up its work again where it was stopped, and its tables hold what was compared."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

STUDY = Path(__file__).parents[2] / "experiments/amplitudes"
MODULES = ("run", "stages", "store", "study", "summary")


@pytest.fixture
def experiment(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The command of the study, as its own folder imports it."""
    monkeypatch.syspath_prepend(str(STUDY))
    import run

    yield run
    for name in MODULES:
        sys.modules.pop(name, None)


def test_the_configs_can_be_read(experiment: ModuleType) -> None:
    configs = experiment.read_configs()
    assert [c.estimation for name, c in configs.items() if name.startswith("amplitude")] == [
        [0.25], [0.5], [0.75], [1.0], [1.25], [1.5]
    ]  # fmt: skip
    assert [c.noise for name, c in configs.items() if name.startswith("noise")] == [10.0, 3.0, 30.0]
    assert configs["joint"].with_published


@pytest.mark.slow
def test_a_deleted_result_is_the_only_one_that_is_made_again(
    experiment: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import stages

    # Discovery has tests of its own, and takes minutes.
    monkeypatch.setattr(stages, "discovery_exists", lambda: False)
    study = experiment.read_study()
    short = study.model_copy(
        update={
            "published": ["identified", "iwan_tables"],
            "sweep": study.sweep.model_copy(update={"growth": 0.4, "rest": 2.0}),
            "step": study.step.model_copy(update={"start": 3.0, "duration": 8.0}),
            "evaluation": study.evaluation.model_copy(update={"sweeps": [1.0], "steps": [0.6]}),
            "calibration": study.calibration.model_copy(
                update={"n_generations": 3, "n_sets": 16, "n_ends": 1}
            ),
        }
    )
    config = experiment.read_configs()["amplitude_1.00"].model_copy(update={"with_published": True})

    def done() -> list[str]:
        reported = experiment.run_study(short, {"one": config}, tmp_path, n_jobs=1)
        return [line.split(" done")[0] for line in reported]

    assert done() == [
        "evaluation: measured", "one: campaign", "one: identify", "one: calibrate", "one: compare"
    ]  # fmt: skip
    summary = (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert {"| linear, one", "| Bouc-Wen, one", "| identified", "| iwan_tables (the truth)"} <= {
        line.rsplit(" |", 2)[0] for line in summary.splitlines()
    }
    assert done() == []
    shutil.rmtree(tmp_path / "one/calibrate")
    assert done() == ["one: calibrate"]
    assert (tmp_path / "summary.md").read_text(encoding="utf-8") == summary


def test_other_settings_make_a_result_again(experiment: ModuleType, tmp_path: Path) -> None:
    from store import Stage

    def work(folder: Path) -> None:
        (folder / "result").write_text("done")

    assert Stage(tmp_path / "stage", {"seed": 1}, work).ensure()
    assert not Stage(tmp_path / "stage", {"seed": 1}, work).ensure()
    assert Stage(tmp_path / "stage", {"seed": 2}, work).ensure()


def test_a_killed_stage_leaves_no_result_and_is_made_by_the_next_run(
    experiment: ModuleType, tmp_path: Path
) -> None:
    from store import Stage

    program = f"""
import sys, time
from pathlib import Path
sys.path.insert(0, {str(STUDY)!r})
from store import Stage
def work(folder):
    (folder / "half").write_text("half")
    time.sleep(300)
Stage(Path({str(tmp_path)!r}) / "stage", {{}}, work).ensure()
"""
    process = subprocess.Popen([sys.executable, "-c", program])
    try:
        deadline = time.monotonic() + 120.0
        while not list(tmp_path.glob(".stage.*.part/half")):
            assert time.monotonic() < deadline
            time.sleep(0.02)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    stage = Stage(tmp_path / "stage", {}, lambda folder: (folder / "whole").touch())
    assert not stage.is_finished
    assert stage.ensure()
    assert {path.name for path in (tmp_path / "stage").iterdir()} == {"whole", "settings.json"}
    assert [path.name for path in tmp_path.iterdir()] == ["stage"]


def test_the_table_marks_all_that_print_as_the_best_and_says_why_a_model_failed(
    experiment: ModuleType, tmp_path: Path
) -> None:
    import summary

    head = "model,record,role,kind,amplitude,signal,quantity,unit,value,noise_floor,n_values,best,problem\n"
    row = "{},sweep_1.00A,validation,sweep,1,u -> psi,magnitude_db,dB,{},0.5,9,no,{}\n"
    for config, value, problem in (
        ("joint", "0.211", ""), ("amplitude_0.50", "0.209", ""), ("amplitude_0.75", "", "it ran away.")
    ):  # fmt: skip
        folder = tmp_path / config / "compare"
        folder.mkdir(parents=True)
        truth = row.format("iwan_tables", "0.1", "")
        (folder / "comparison.csv").write_text(head + row.format("discover", value, problem) + truth)
    # Without a single number a model has no line; this one has one elsewhere.
    step = "discover,step_1.00A,validation,step,1,psi,step_rmse,rad,0.001,0.0001,9,no,\n"
    with (tmp_path / "amplitude_0.75/compare/comparison.csv").open("a") as file:
        file.write(step)
    lines = summary.summary_text(tmp_path).splitlines()
    assert "| discovered, joint | **0.21** |" in lines
    assert "| discovered, amplitude 0.50 | **0.21** |" in lines
    assert "| discovered, amplitude 0.75 | failed |" in lines
    assert "| iwan_tables (the truth) | 0.10 |" in lines
    assert "- 'discovered, amplitude 0.75' failed on sweep_1.00A: it ran away." in lines
