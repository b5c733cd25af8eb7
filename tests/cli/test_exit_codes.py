"""A defect, an interruption and output that nobody takes end in one message and an exit code, and leave nothing behind."""

from __future__ import annotations

import errno
import io
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from rigsight.cli.exit_codes import report_errors
from rigsight.workflow.run.progress import Stage, listening
from rigsight.workflow.run.results import write_together

RIGSIGHT = Path(sys.executable).with_name("rigsight")
Run = Callable[..., tuple[int, str, str]]


def test_a_defect_exits_1_with_one_line(
    axis_campaign: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def defective(*_: object, **__: object) -> None:
        raise ZeroDivisionError("a\nb")

    monkeypatch.setattr("rigsight.workflow.diagnose.diagnose", defective)
    arguments = (
        "diagnose",
        axis_campaign,
        "-o",
        tmp_path / "out",
        "--effect",
        "cubic_stiffness",
        "--jobs",
        "1",
    )
    code, _, stderr = run(*arguments, "--quiet")
    assert code == 1
    assert stderr.count("\n") == 1
    assert "ZeroDivisionError: a b" in stderr
    assert "--debug" in stderr
    assert not (tmp_path / "out").exists()
    with pytest.raises(ZeroDivisionError):
        run(*arguments, "--debug")


@pytest.mark.skipif(sys.platform == "win32", reason="paths differ there")
def test_a_path_that_cannot_exist_is_told(
    axis_campaign: Path, write_model: Callable[..., Path], tmp_path: Path, run: Run
) -> None:
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    long = "x" * 300
    for arguments in (
        ("diagnose", long),
        ("simulate", write_model(), long),
        ("simulate", write_model(), loop / "fit.csv"),
        ("simulate", write_model(), axis_campaign / "fit.csv" / "fit.csv"),
    ):
        code, _, stderr = run(*arguments)
        assert (code, stderr.count("\n")) == (2, 1), stderr
        assert "defect" not in stderr


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
@pytest.mark.parametrize(
    ("stage", "candidates"),
    # So many that they are not compiled when the request comes, and some that take long to be fitted.
    [
        pytest.param("Compiling", (), marks=pytest.mark.slow),
        ("Diagnosing", ("iwan_hysteresis", "bouc_wen_hysteresis")),
    ],
)
def test_an_interrupted_diagnosis_leaves_nothing(
    stage: str, candidates: tuple[str, ...], axis_campaign: Path, tmp_path: Path
) -> None:
    out = tmp_path / "new" / "out"
    environment = dict(os.environ)
    if stage == "Compiling":
        environment["RIGSIGHT_CACHE_DIR"] = str(tmp_path / "kernels")
    chosen = [word for name in candidates for word in ("--effect", name)]
    process = subprocess.Popen(
        [RIGSIGHT, "diagnose", axis_campaign, "-o", out, "--jobs", "2", *chosen],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stderr is not None
    seen = ""
    for line in process.stderr:
        seen += line
        if line.startswith(stage):
            break
    time.sleep(0.5)
    # As a terminal does it: to the whole group, worker processes included.
    os.killpg(process.pid, signal.SIGINT)
    stdout, stderr = process.communicate(timeout=180)
    assert process.returncode == 130, seen + stderr
    assert stdout == ""
    assert "Traceback" not in stderr
    assert stderr.strip().endswith("interrupted; nothing was written; the same command continues from there.")
    assert not out.parent.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
@pytest.mark.parametrize(
    ("number", "expected"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129), (signal.SIGINT, 130)]
)
def test_requests_to_end_end_like_ctrl_c(
    number: signal.Signals,
    expected: int,
    axis_campaign: Path,
    tmp_path: Path,
    run: Run,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("rigsight.workflow.diagnose.diagnose", lambda *_, **__: signal.raise_signal(number))
    monkeypatch.setattr("rigsight.workflow.diagnose.prepare_kernels", lambda *_, **__: None)
    before = signal.getsignal(number)
    code, stdout, stderr = run("diagnose", axis_campaign, "-o", tmp_path / "out", "--quiet")
    assert (code, stdout) == (expected, "")
    assert stderr == "rigsight: interrupted; nothing was written; the same command continues from there.\n"
    assert not (tmp_path / "out").exists()
    assert signal.getsignal(number) == before


@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
def test_who_does_not_want_to_be_ended_by_a_terminal_is_not(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def listed(*_: object, **__: object) -> tuple[()]:
        signal.raise_signal(signal.SIGHUP)
        return ()

    monkeypatch.setattr("rigsight.workflow.own.own_effects.own_effects", listed)
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert run("effects")[0] == 0
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.skipif(sys.platform == "win32", reason="pipes differ there")
def test_output_that_nobody_reads_ends_without_a_word() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    shown = subprocess.run([RIGSIGHT, "effects"], stdout=writer, stderr=subprocess.PIPE, check=False)
    os.close(writer)
    assert (shown.returncode, shown.stderr) == (141, b"")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device here that is always full")
def test_output_that_finds_no_room_is_told(axis_campaign: Path) -> None:
    record = axis_campaign / "fit.csv"
    with Path("/dev/full").open("wb") as full:
        shown = subprocess.run(
            [RIGSIGHT, "inspect", record], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert shown.returncode == 2
    assert shown.stderr.startswith("rigsight: the output cannot be printed: No space left on device.")
    assert shown.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "set TMPDIR"),
        (FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp']"), "set TMPDIR"),
        (
            PermissionError(errno.EACCES, "Permission denied", "/there"),
            "no permission to read or write /there. Change its permissions",
        ),
    ],
)
def test_a_disk_that_takes_or_gives_nothing_is_no_defect(
    error: OSError, expected: str, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("rigsight.workflow.own.own_effects.own_effects", fails)
    code, stdout, stderr = run("effects")
    assert (code, stdout, stderr.count("\n")) == (2, "", 1)
    assert expected in stderr


def test_a_log_that_is_full_stops_no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    class Full(io.StringIO):
        def write(self, _: str) -> int:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(sys, "stderr", Full())
    with listening(quiet=False) as listener:
        Stage("Diagnosing", 2, listener).finished("one")


def test_a_process_without_stderr_works(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", None)
    with listening(quiet=False) as listener:
        Stage("Diagnosing", 2, listener).finished("one")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Gone(Terminal):
    def write(self, _: str) -> int:
        raise OSError(errno.EIO, "Input/output error")


def test_a_terminal_that_went_away_hides_no_interruption(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Gone())
    monkeypatch.setenv("TERM", "xterm")

    def interrupted() -> None:
        with listening(quiet=False) as listener:
            Stage("Diagnosing", 4, listener).finished("one")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()


def test_who_is_interrupted_when_all_is_written_is_told_so(
    axis_campaign: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diagnosed(*_: object, **__: object) -> None:
        write_together(tmp_path / "out", {"diagnosis.json": "{}"})
        raise KeyboardInterrupt

    monkeypatch.setattr("rigsight.workflow.diagnose.diagnose_campaign", diagnosed)
    code, _, stderr = run("diagnose", axis_campaign, "-o", tmp_path / "out", "--quiet")
    assert code == 130
    assert stderr == f"rigsight: interrupted; the files written in {tmp_path / 'out'} are complete.\n"


def test_a_bench_that_is_interrupted_goes_on_and_its_settings_are_no_results(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted() -> None:
        write_together(tmp_path / "bench" / "keys", {"settings.json": "{}"})
        raise KeyboardInterrupt

    with (
        pytest.raises(SystemExit),
        report_errors(debug=False, outcome="the same command continues from here"),
    ):
        interrupted()
    assert capsys.readouterr().err == "rigsight: interrupted; the same command continues from here.\n"


@pytest.mark.parametrize("number", [errno.EMFILE, errno.EFBIG])
def test_a_limit_of_the_session_is_no_defect(
    number: int, axis_campaign: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def limited(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("rigsight.workflow.diagnose.diagnose_campaign", limited)
    code, _, stderr = run("diagnose", axis_campaign, "-o", tmp_path / "out", "--quiet")
    assert code == 2
    assert stderr.startswith(
        f"rigsight: a resource limit of this session was reached: {os.strerror(number)}."
    )


def test_a_terminal_shows_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    with listening(quiet=False) as listener:
        stage = Stage("Diagnosing", 4, listener)
        for name in ("one", "two", "three"):
            stage.finished(name)
    assert re.search(r"3/4.*\d:\d\d:\d\d.* left .*\d:\d\d:\d\d.*three", shown.getvalue())


def test_many_folders_with_results_are_told_by_the_one_that_holds_them(
    axis_campaign: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diagnosed(*_: object, **__: object) -> None:
        for number in range(5):
            write_together(tmp_path / "bench" / str(number), {"diagnosis.json": "{}"})
        raise KeyboardInterrupt

    monkeypatch.setattr("rigsight.workflow.diagnose.diagnose_campaign", diagnosed)
    _, _, stderr = run("diagnose", axis_campaign, "-o", tmp_path / "out", "--quiet")
    assert (
        stderr
        == f"rigsight: interrupted; the files written in 5 folders in {tmp_path / 'bench'} are complete.\n"
    )
