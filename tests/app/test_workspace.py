"""Uploads, edited text and removed files: nothing is overwritten, nothing half, nothing outside of the folder."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from rigsight.app.workspace import (
    Draft,
    campaign_text,
    find_draft,
    inside,
    keep_draft,
    opened,
    receive,
    safe_name,
    save_campaign,
    set_aside,
)
from rigsight.errors import InputError, MachineError
from rigsight.records.formats.known import LARGEST_FILE


async def chunks(*parts: bytes, then: BaseException | None = None) -> AsyncIterator[bytes]:
    for part in parts:
        yield part
    if then is not None:
        raise then


def upload(
    folder: Path, name: str, *parts: bytes, size: int | None = None, then: BaseException | None = None
) -> Path:
    announced = sum(map(len, parts)) if size is None else size
    return asyncio.run(receive(folder, name, chunks(*parts, then=then), announced))


def files(folder: Path) -> Iterator[str]:
    return (str(path.relative_to(folder)) for path in sorted(folder.rglob("*")) if path.is_file())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return opened(tmp_path / "outer" / "campaign")


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("a b.csv", "a b.csv"),
        ("../../x", "x"),
        ("/etc/passwd", "passwd"),
        ("..\\..\\x.csv", "x.csv"),
        ("C:\\data\\x.csv", "x.csv"),
        ("größe.csv", "größe.csv"),
    ],
)
def test_of_a_path_only_the_last_name_is_kept(name: str, kept: str, folder: Path) -> None:
    assert upload(folder, name, b"t,u\n") == folder / kept
    assert list(files(folder.parents[1])) == [f"outer/campaign/{kept}"]


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../..", "a/", ".hidden", "a\nb", "a\0b", "x:y", "n" * 151, " "]
)
def test_other_names_are_refused(name: str, folder: Path) -> None:
    with pytest.raises(InputError):
        upload(folder, name, b"x")
    assert list(files(folder)) == []


def test_a_file_is_never_overwritten(folder: Path) -> None:
    upload(folder, "a.csv", b"first")
    (folder / "link.csv").symlink_to(folder.parent / "elsewhere.csv")
    for name in ("a.csv", "link.csv"):
        with pytest.raises(InputError):
            upload(folder, name, b"second")
    assert (folder / "a.csv").read_bytes() == b"first"
    assert not (folder.parent / "elsewhere.csv").exists()


@pytest.mark.parametrize(
    ("size", "then"),
    [
        (None, ConnectionError("closed")),
        (9, None),
        (3, None),
        (LARGEST_FILE + 1, None),
        (10**18, None),
        (None, OSError(28, "full")),
    ],
)
def test_of_a_broken_upload_nothing_stays(size: int | None, then: BaseException | None, folder: Path) -> None:
    with pytest.raises((InputError, ConnectionError)):
        upload(folder, "a.csv", b"12", b"34", size=size, then=then)
    assert list(files(folder)) == []
    assert upload(folder, "a.csv", b"1234").read_bytes() == b"1234"


def test_a_full_disk_is_no_fault_of_the_file(folder: Path) -> None:
    with pytest.raises(MachineError):
        upload(folder, "a.csv", b"12", then=OSError(28, "full"))


def test_only_files_of_the_folder_are_served(folder: Path) -> None:
    upload(folder, "a.csv", b"x")
    (folder.parent / "secret").write_text("x")
    (folder / "link").symlink_to(folder.parent / "secret")
    (folder / "out").symlink_to(folder.parent)
    assert inside(folder, "a.csv") == folder / "a.csv"
    for path in ("../secret", "link", "out/secret", "/etc/passwd", "", ".", "a\0", "../campaign2/a.csv"):
        assert inside(folder, path) is None


def test_a_file_with_the_name_of_the_folder_of_removed_ones_can_be_removed(folder: Path) -> None:
    upload(folder, "removed", b"1")
    upload(folder, "a.csv", b"2")
    assert set_aside(folder, "a.csv") == folder / "removed-2" / "a.csv"
    assert set_aside(folder, "removed") == folder / "removed-2" / "removed"


def test_what_is_removed_is_moved_beside_what_was_removed_before(folder: Path) -> None:
    for content in (b"1", b"2", b"3"):
        upload(folder, "a.csv", content)
        set_aside(folder, "a.csv")
    assert [(folder / "removed" / name).read_bytes() for name in ("a.csv", "a-2.csv", "a-3.csv")] == [
        b"1",
        b"2",
        b"3",
    ]
    with pytest.raises(InputError):
        set_aside(folder, "../campaign/gone.csv")


def test_typed_text_is_kept_until_it_is_saved(folder: Path) -> None:
    first = Draft("a = 1\n", None)
    keep_draft(folder, first, None)
    assert (find_draft(folder), campaign_text(folder)) == (Draft("a = 1\n", ""), None)
    assert save_campaign(folder, first) is None
    assert (find_draft(folder), campaign_text(folder)) == (None, "a = 1\n")
    second = Draft("a = 2\r\n", "a = 1\n")
    keep_draft(folder, second, None)
    assert find_draft(folder) == second
    keep_draft(folder, Draft("a = 1\n", "a = 1\n"), second)
    assert find_draft(folder) is None


def test_of_two_windows_no_text_is_lost(folder: Path) -> None:
    (folder / "campaign.toml").write_text("a = 0\n")
    left, right = Draft("left", "a = 0\n"), Draft("right", "a = 0\n")
    keep_draft(folder, left, None)
    keep_draft(folder, right, None)
    assert (folder / "removed" / "draft.toml").read_text() == "left"
    assert save_campaign(folder, left) is None
    aside = save_campaign(folder, right)
    assert aside is not None
    assert (aside.read_text(), campaign_text(folder)) == ("left", "right")


def test_safe_names_stay_as_they_are() -> None:
    assert safe_name(safe_name("../x.csv")) == "x.csv"


def test_a_file_in_the_way_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError):
        opened(tmp_path / "file")
