from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
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
    temporary_path,
    write_locked,
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
@pytest.mark.parametrize("fails_at", ["fsync", "replace"])
def test_a_failure_leaves_no_part_and_no_folder(
    error: BaseException, fails_at: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    owner = os if fails_at == "fsync" else Path
    original = getattr(owner, fails_at)

    def failing(*arguments: object) -> object:
        calls.append(arguments)
        if len(calls) == 2:
            raise error
        return original(*arguments)

    monkeypatch.setattr(owner, fails_at, failing)
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
    def interrupted() -> Iterator[Sequence[int]]:
        with signals_held() as held:
            yield held
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(results, "signals_held", interrupted)
    with results.noting_folders() as written, pytest.raises(KeyboardInterrupt):
        write_together(tmp_path / "out", CONTENTS)
    assert {path.name: path.read_text("utf-8") for path in (tmp_path / "out").iterdir()} == CONTENTS
    assert written == [tmp_path / "out"]
    with results.noting_folders() as others:
        assert others == []


def test_a_failure_keeps_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.txt").write_text("mine")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "no space")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="disk is full"):
        write_together(tmp_path, CONTENTS)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


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


@pytest.mark.parametrize("error", [PermissionError(errno.EACCES, "open elsewhere"), KeyboardInterrupt()])
@pytest.mark.parametrize("links", [True, False])
def test_a_file_that_cannot_get_its_name_brings_the_old_ones_back(
    error: BaseException, links: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.json").write_text("old")
    original = Path.replace

    def failing(part: Path, target: Path) -> Path:
        if part.suffix == ".part" and target.name == "b.html":
            raise error
        return original(part, target)

    def unknown(*_: object) -> None:
        raise OSError(errno.EPERM, "this file system has no links")

    monkeypatch.setattr(Path, "replace", failing)
    if not links:
        monkeypatch.setattr(Path, "hardlink_to", unknown)
    with pytest.raises((InputError, KeyboardInterrupt)):
        write_together(tmp_path, {"a.json": "new", "c.csv": "new", "b.html": "new"})
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.json": "old"}


@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_files_get_their_names_waits_and_leaves_the_old_ones(
    number: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.json").write_text("old")
    original = Path.replace
    ends = []

    def interrupted(part: Path, target: Path) -> Path:
        signal.raise_signal(number)
        return original(part, target)

    def end(*_: object) -> None:
        ends.append({path.name: path.read_text() for path in tmp_path.iterdir()})
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    before = signal.signal(number, end)
    try:
        with pytest.raises(KeyboardInterrupt):
            write_together(tmp_path, CONTENTS)
    finally:
        signal.signal(number, before)
    assert ends[0].items() >= {"a.json": "old"}.items()
    assert "b.html" not in ends[0]
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.json": "old"}


def test_what_a_killed_run_left_is_removed_but_no_file_of_a_run_at_work(tmp_path: Path) -> None:
    pytest.importorskip("fcntl", reason="nothing tells there whether a writer lives")
    left = [
        temporary_path(tmp_path / name, "0a1b2c3d", ending) for name in CONTENTS for ending in ("part", "old")
    ]
    for path in left:
        path.write_text("left")
    mine = tmp_path / ".a.json.draft.part"
    mine.write_text("mine")
    with write_locked(temporary_path(tmp_path / "a.json", "ffffffff", "part"), b"at work") as at_work:
        write_together(tmp_path, CONTENTS)
        names = sorted(path.name for path in tmp_path.iterdir())
        assert names == sorted([mine.name, Path(at_work.name).name, *CONTENTS])


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
