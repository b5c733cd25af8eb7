from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from rigsight.errors import InputError
from rigsight.workflow.results import (
    check_target,
    check_writable,
    json_text,
    removed_on_failure,
    write_together,
)

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
    with pytest.raises(InputError, match="no ordinary file"):
        check_target(Path("/dev/null"))
    with pytest.raises(InputError, match="no ordinary file"):
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


@pytest.mark.parametrize("existed", [True, False])
def test_a_folder_is_removed_with_a_failure_only_if_it_is_new(existed: bool, tmp_path: Path) -> None:
    folder = tmp_path / "out" / "campaign"
    if existed:
        folder.mkdir(parents=True)

    def fail() -> None:
        with removed_on_failure(folder):
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "record.csv").write_text("t,u\n")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert folder.exists() == existed
    assert (tmp_path / "out").exists() == existed
