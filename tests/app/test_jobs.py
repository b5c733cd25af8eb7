"""A command is found again by whoever asks: while it runs, when it has ended, and when it was killed."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("psutil", reason="the extra app is not installed")

from rigsight.app import jobs
from rigsight.app.steps import Site, picture_of
from rigsight.errors import InputError


def wait(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def ended(root: Path, name: str = "run") -> jobs.Job:
    wait(lambda: (job := jobs.find(root, name)) is not None and not job.is_running)
    found = jobs.find(root, name)
    assert found is not None
    return found


def test_a_command_runs_in_the_folder_and_its_end_is_known(tmp_path: Path) -> None:
    assert jobs.find(tmp_path, "run") is None
    jobs.start(tmp_path, "run", ["--version"])
    job = ended(tmp_path)
    assert (job.exit_code, job.arguments, job.messages()) == (0, ("--version",), [])
    assert job.output.startswith("rigsight ")
    jobs.start(tmp_path, "run", ["nonsense"])
    job = ended(tmp_path)
    assert job.exit_code == 2
    assert any("nonsense" in message for message in job.messages())
    assert jobs.running(tmp_path) == []


def test_a_running_command_is_found_refuses_a_second_and_can_be_canceled(tmp_path: Path) -> None:
    jobs.start(tmp_path, "run", ["app", "served", "--no-browser", "--json"])
    found = jobs.find(tmp_path, "run")
    assert found is not None
    assert found.is_running
    assert [job.folder for job in jobs.running(tmp_path)] == [found.folder]
    with pytest.raises(InputError):
        jobs.start(tmp_path, "run", ["--version"])
    wait(lambda: "}" in found.output)
    assert json.loads(found.output)["address"].startswith("http://127.0.0.1:")
    found.cancel()
    assert ended(tmp_path).exit_code in jobs.CANCELED


def test_a_killed_command_is_not_taken_for_a_running_one(tmp_path: Path) -> None:
    job = jobs.start(tmp_path, "run", ["app", "served", "--no-browser"])
    os.killpg(job.pid, signal.SIGKILL)
    assert ended(tmp_path).exit_code is None
    ended(tmp_path).cancel()


def test_a_later_process_of_the_same_number_is_another_one(tmp_path: Path) -> None:
    folder = tmp_path / ".rigsight-app" / "jobs" / "run"
    folder.mkdir(parents=True)
    content = {"arguments": ["demo"], "started": 0.0, "pid": os.getpid(), "created": 12.0}
    (folder / "job.json").write_text(json.dumps(content))
    found = jobs.find(tmp_path, "run")
    assert found is not None
    assert not found.is_running
    (folder / "job.json").write_text("{")
    assert jobs.find(tmp_path, "run") is None


def test_progress_is_read_from_lines_that_may_be_cut(tmp_path: Path) -> None:
    steps = [
        ("a note", 0, 0, 0.5),
        ("Reading", 0, 2, 1.0),
        ("Reading", 2, 2, 3.0),
        ("Fitting", 0, 8, 3.0),
        ("Fitting", 2, 8, 7.0),
    ]
    lines = [
        json.dumps({"stage": s, "detail": "x", "done": d, "total": n, "seconds": t}) for s, d, n, t in steps
    ]
    (tmp_path / "stderr").write_text("\n".join([*lines, "rigsight: told.", lines[0][:20]]))
    job = jobs.Job(tmp_path, ("demo",), 0.0, 1, time.time() - 7.0)
    progress = job.progress()
    assert progress is not None
    assert progress.share == 0.25
    # Two of eight in four seconds.
    assert progress.seconds_left == pytest.approx(12.0, abs=2.0)
    assert job.messages() == ["a note", "rigsight: told."]


def done(site: Site) -> set[str]:
    return {step.title for step in site.steps() if step.is_done}


def test_the_state_of_the_steps_is_the_folder(axis_campaign: Path) -> None:
    site = Site(axis_campaign, ("diagnose", "export"))
    assert [(step.address, step.is_done) for step in site.steps()] == [
        ("/", True), ("/rig", True), ("/campaign", True), ("/diagnosis", False), ("/export", False),
    ]  # fmt: skip
    assert [run.command for run in Site(axis_campaign, ("check", "diagnose", "plan")).runs] == [
        "check",
        "diagnose",
        "plan",
    ]
    (axis_campaign / "diagnosis").mkdir()
    (axis_campaign / "diagnosis" / "report.html").write_text("")
    os.utime(axis_campaign / "campaign.toml", (1, 1))
    assert not site.is_outdated("diagnosis/report.html")
    assert done(site) == {"Files", "Rig", "Campaign", "Diagnosis"}
    (axis_campaign / "campaign.toml").write_text("titel = 'slip'\n")
    os.utime(axis_campaign / "diagnosis" / "report.html", (1, 1))
    assert site.is_outdated("diagnosis/report.html")
    assert done(site) == {"Files", "Rig"}
    assert site.results("diagnosis") == ["diagnosis/report.html"]


def test_a_name_with_a_dash_is_no_option(tmp_path: Path) -> None:
    for name in ("--debug.csv", "a.csv"):
        (tmp_path / name).write_text("t,u\n" + "".join(f"{0.1 * i},{i % 7}\n" for i in range(60)))
    jobs.start(tmp_path, "run", Site(tmp_path, ()).inspection("--debug.csv"))
    assert ended(tmp_path).exit_code == 0
    assert (tmp_path / picture_of("--debug.csv")).is_file()
    assert Site(tmp_path, ()).inspection("a.csv")[1] == "a.csv"


def test_a_plan_is_for_the_rivals_of_the_diagnosis_once_there_is_one(axis_campaign: Path) -> None:
    site = Site(axis_campaign, ("plan",))
    (step,) = site.runs
    assert site.arguments(step, ["--limit", "u=3"]) == ("plan", ".", "--out", "plan", "--limit", "u=3")
    (axis_campaign / "diagnosis").mkdir()
    (axis_campaign / "diagnosis" / "diagnosis.json").write_text("{}")
    assert site.arguments(step) == ("plan", ".", "--out", "plan", "--diagnosis", "diagnosis")
