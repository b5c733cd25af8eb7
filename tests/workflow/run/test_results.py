from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from rigsight.errors import InputError
from rigsight.workflow.compare import run_compare
from rigsight.workflow.diagnose import run_diagnose
from rigsight.workflow.identify import run_identify
from rigsight.workflow.run import results
from rigsight.workflow.run.results import (
    check_target,
    check_writable,
    json_text,
    write_together,
)
from rigsight.workflow.vary import run_vary

CONTENTS = {"a.json": "{}\n", "b.html": "<p>ä</p>\n"}


def test_files_are_written_together_into_a_new_folder(tmp_path: Path) -> None:
    written = write_together(tmp_path / "new" / "out", CONTENTS)
    assert [path.name for path in written] == list(CONTENTS)
    assert {path.name: path.read_text("utf-8") for path in (tmp_path / "new/out").iterdir()} == CONTENTS


def test_earlier_results_are_replaced_and_other_files_stay(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("old")
    (tmp_path / "mine.txt").write_text("mine")
    write_together(tmp_path, CONTENTS)
    assert (tmp_path / "a.json").read_text() == "{}\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.json", "b.html", "mine.txt"]


def test_what_is_in_the_way_is_told_before_the_work(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "nowhere")
    for folder in (link, link / "out"):
        with pytest.raises(
            InputError, match=r"is a link to .*nowhere, which does not exist\. Name another folder"
        ):
            check_writable(folder)
    (tmp_path / "a.json").mkdir()
    check_writable(tmp_path, "b.html")
    with pytest.raises(InputError, match=r"a\.json: it is a folder"):
        check_writable(tmp_path, "b.html", "a.json")


def test_every_command_checks_its_files_before_the_work(axis_campaign: Path, tmp_path: Path) -> None:
    for name, run in (
        ("diagnosis.json", run_diagnose),
        ("comparison.html", lambda campaign, out: run_compare(campaign, ["nowhere"], out)),
        ("vary.json", lambda _, out: run_vary("nowhere", ["k"], out)),
        ("model.json", run_identify),
    ):
        (tmp_path / name / name).mkdir(parents=True)
        with pytest.raises(InputError, match=f"{name}: it is a folder"):
            run(axis_campaign, tmp_path / name)


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "no space"), KeyboardInterrupt()])
def test_a_failure_leaves_no_part_and_no_folder(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    original = Path.write_bytes

    def failing(path: Path, content: bytes) -> int:
        calls.append(path)
        written = original(path, content)
        if len(calls) == 2:
            raise error
        return written

    monkeypatch.setattr(Path, "write_bytes", failing)
    with pytest.raises((InputError, KeyboardInterrupt)) as raised:
        write_together(tmp_path / "new" / "out", CONTENTS)
    assert len(calls) == 2
    assert list(tmp_path.iterdir()) == []
    if isinstance(error, OSError):
        assert "the disk is full" in str(raised.value)


@pytest.mark.parametrize("when", ["before", "after"])
def test_an_interruption_while_folders_are_made_leaves_none(
    when: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = Path.mkdir

    def interrupted(path: Path, **options: bool) -> None:
        if when == "after" or path.name == "out":
            original(path, **options)
        if path.name == "out" or when == "before":
            raise KeyboardInterrupt

    monkeypatch.setattr(Path, "mkdir", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_together(tmp_path / "new" / "out", CONTENTS)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
def test_a_signal_that_comes_when_all_is_in_place_leaves_the_new_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    signals_held = results.signals_held

    @contextlib.contextmanager
    def interrupted() -> Iterator[None]:
        with signals_held():
            yield
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(results, "signals_held", interrupted)
    with results.noting_folders() as written, pytest.raises(KeyboardInterrupt):
        write_together(tmp_path / "out", CONTENTS)
    assert {path.name: path.read_text("utf-8") for path in (tmp_path / "out").iterdir()} == CONTENTS
    assert written == [tmp_path / "out"]
    with results.noting_folders() as others:
        assert others == []


def test_a_folder_with_the_name_of_a_result_is_told(tmp_path: Path) -> None:
    (tmp_path / "out" / "b.html").mkdir(parents=True)
    with pytest.raises(InputError, match="is a folder"):
        write_together(tmp_path / "out", CONTENTS)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["b.html"]


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="no devices here")
def test_a_device_is_never_replaced() -> None:
    with pytest.raises(InputError, match="is a device or a pipe"):
        check_target(Path("/dev/null"))
    with pytest.raises(InputError, match="is a device or a pipe"):
        write_together(Path("/dev"), {"null": ""})
    assert not Path("/dev/null").is_file()


def test_a_link_keeps_pointing_where_it_does(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "a.json").symlink_to(tmp_path / "kept" / "real.json")
    write_together(tmp_path, {"a.json": "new"})
    assert (tmp_path / "a.json").is_symlink()
    assert (tmp_path / "kept" / "real.json").read_text() == "new"


def test_looking_whether_a_folder_can_be_written_leaves_nothing(tmp_path: Path) -> None:
    check_writable(tmp_path / "new" / "out")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file"):
        check_writable(tmp_path / "file" / "out")


def test_numbers_that_json_cannot_hold_are_refused() -> None:
    with pytest.raises(ValueError, match="JSON"):
        json_text({"value": float("nan")})


@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_files_get_their_names_waits(
    number: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.json").write_text("old")
    original = Path.replace

    def interrupted(part: Path, target: Path) -> Path:
        signal.raise_signal(number)
        return original(part, target)

    def end(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    before = signal.signal(number, end)
    try:
        with pytest.raises(KeyboardInterrupt):
            write_together(tmp_path, CONTENTS)
    finally:
        signal.signal(number, before)
    assert {path.name: path.read_text("utf-8") for path in tmp_path.iterdir()} == CONTENTS


def test_what_a_killed_run_left_is_replaced(tmp_path: Path) -> None:
    (tmp_path / ".a.json.part").write_text("left")
    write_together(tmp_path, CONTENTS)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(CONTENTS)


def test_files_in_folders_inside_are_written_with_the_others(tmp_path: Path) -> None:
    write_together(tmp_path / "out", {"campaign/a.csv": "a", "b.json": "b"})
    assert (tmp_path / "out/campaign/a.csv").read_text() == "a"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="limits of a process are set between fork and exec")
@pytest.mark.parametrize("bytes_left", [1_000, 30_000])
def test_a_disk_that_is_full_for_real_leaves_the_old_files(bytes_left: int, tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    for name in ("a", "b"):
        (tmp_path / name).write_text("old")
    code = (
        "import sys; from pathlib import Path; from rigsight.errors import InputError\n"
        "from rigsight.workflow.run.results import write_together\n"
        "try: write_together(Path(sys.argv[1]), {'a': 'x' * 20_000, 'b': 'x' * 40_000})\n"
        "except InputError as error: sys.exit(str(error))"
    )

    def limit() -> None:
        # What a file may grow to: the same failure of a write as on a full disk, without one.
        resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_left, bytes_left))

    run = subprocess.run(
        [sys.executable, "-B", "-c", code, tmp_path],
        preexec_fn=limit,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 1
    assert "Cannot write results" in run.stderr
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "old", "b": "old"}
