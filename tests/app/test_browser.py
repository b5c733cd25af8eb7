"""The pages in a real browser: a first use without the command line, by mouse or keyboard, whatever happens in between."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nicegui", reason="the extra app is not installed")

from rigsight.app import jobs

from ..chromium import BROWSERS, Chromium, find
from . import first_use
from .served import Server, Visitor, wait_for

pytestmark = pytest.mark.release
Window = Callable[[Server], Visitor]


@pytest.fixture
def window(tmp_path: Path) -> Iterator[Window]:
    """Open windows, each in a browser of its own."""
    path = find()
    if path is None:
        pytest.skip(f"no browser here ({', '.join(BROWSERS)}); the pages were not tried")
    browsers: list[Chromium] = []

    def open_window(server: Server) -> Visitor:
        browsers.append(Chromium(path, tmp_path / f"browser-{len(browsers)}"))
        return Visitor(browsers[-1], server)

    yield open_window
    for browser in browsers:
        browser.close()


@pytest.fixture
def serve() -> Iterator[Callable[..., Server]]:
    servers: list[Server] = []

    def start(folder: Path, *options: str) -> Server:
        servers.append(Server(folder, *options))
        return servers[-1]

    yield start
    for server in servers:
        server.end()
        for job in jobs.running(server.folder):
            os.killpg(job.pid, signal.SIGKILL)


@pytest.fixture
def logged(tmp_path: Path, axis_rows: dict[str, np.ndarray]) -> list[Path]:
    """Files of a logger, whose columns say neither signals nor SI units."""
    folder = tmp_path / "logger"
    folder.mkdir()
    for name, rows in axis_rows.items():
        lines = ["time_ms,force_N,position_mm", *(f"{1e3 * t:.9g},{u:.9g},{1e3 * x:.9g}" for t, u, x in rows)]
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / first_use.FOREIGN).write_text("day,dish\nMonday,soup\n", encoding="utf-8")
    return sorted(folder.iterdir())


def with_values(text: str) -> str:
    """Fill in the values of the given simulation."""
    for name, value in {"m": 2.0, "d": 5.0, "k": 800.0}.items():
        text, count = re.subn(rf"^# {name} = ", f"{name} = {value}", text, flags=re.MULTILINE)
        assert count == 1
    return text


def test_a_first_use(
    tmp_path: Path, logged: list[Path], serve: Callable[..., Server], window: Window
) -> None:
    visitor = window(serve(tmp_path / "campaign"))
    first_use.do_all(visitor, logged, with_values, "cubic")
    assert visitor.chromium.complaints() == []
    outside = [
        url
        for url in visitor.chromium.requests()
        if not url.startswith((visitor.server.origin, "data:", "blob:"))
    ]
    assert outside == []


def test_every_page_has_names_and_can_be_used_by_keyboard(
    axis_campaign: Path, serve: Callable[..., Server], window: Window
) -> None:
    visitor = window(serve(axis_campaign))
    for path in (
        "/",
        "/file?name=fit.csv",
        "/rig",
        "/campaign",
        "/diagnosis",
        "/plan",
        "/power",
        "/discovery",
        "/export",
    ):
        visitor.go(path)
        visitor.chromium.wait(
            "!document.querySelector('.editor') || !!document.querySelector('.cm-content[aria-label]')"
        )
        told = visitor.chromium.named()
        for role in ("button", "link", "textbox", "combobox", "progressbar", "Iframe", "image", "table"):
            assert [name for found, name in told if found == role and not name] == [], (path, role)
        assert [name for role, name in told if role == "main"] == [""], path
        assert sum(role == "heading" for role, _ in told) >= 1
    visitor.go("/campaign")
    visitor.text_of_campaign()
    visitor.chromium.evaluate("document.querySelector('.cm-content').focus()")
    visitor.chromium.key("Escape")
    visitor.chromium.key("Tab")
    assert visitor.chromium.evaluate("document.activeElement.innerText").startswith("Next")
    visitor.go("/")
    visitor.chromium.key("Tab")
    visitor.chromium.key("Enter", text="\r")
    visitor.chromium.wait("document.activeElement.matches('main.content')")
    visitor.go("/")
    visitor.chromium.key("Tab")
    links = "[...document.querySelectorAll('header a, nav a')].map((e) => e.innerText)"
    for link in (*visitor.chromium.evaluate(links), "files"):
        visitor.chromium.key("Tab")
        focused = visitor.chromium.evaluate("document.activeElement.innerText || document.activeElement.id")
        assert focused == link
    visitor.chromium.evaluate("[...document.querySelectorAll('nav a')][1].focus()")
    visitor.chromium.key("Enter", text="\r")
    visitor.wait_to_see("Is this its rig?")


def test_what_is_typed_or_chosen_is_in_the_command_and_there_again_after_a_run(
    axis_campaign: Path, serve: Callable[..., Server], window: Window
) -> None:
    for name in ("own.py", "other.py"):
        (axis_campaign / name).write_text("")
    earlier = jobs.start(axis_campaign, "power", ("power", "nowhere", "--effects", "own.py"))
    visitor = window(serve(axis_campaign))
    visitor.go("/power")
    visitor.wait_to_see("A file chosen here is run")
    wait_for(lambda: not earlier.is_running, "the end of the earlier run")
    visitor.wait_to_see("rigsight power . --out power --effects own.py")
    visitor.choose("other.py")
    visitor.wait_to_see("--effects own.py --effects other.py")
    visitor.go("/plan")
    visitor.chromium.evaluate("document.querySelector('input[aria-label^=Limits]').focus()")
    visitor.chromium.send("Input.insertText", text="u=3 x=0.02")
    visitor.wait_to_see("rigsight plan . --out plan --limit u=3 --limit x=0.02")
    visitor.go("/rig")
    assert not visitor.sees("Joints that a brake holds")


def test_two_windows_a_reload_and_a_closed_browser_lose_nothing(
    axis_campaign: Path, serve: Callable[..., Server], window: Window
) -> None:
    server = serve(axis_campaign)
    left, right = window(server), window(server)
    before = (axis_campaign / "campaign.toml").read_text(encoding="utf-8")
    left.go("/campaign")
    right.go("/campaign")
    left.type_campaign(before.replace("stage", "left"))
    left.wait_to_see("Not saved yet")
    left.go("/campaign")
    assert "left" in left.text_of_campaign()
    left.wait_to_see("Not saved yet")
    left.press("Save")
    left.wait_to_see("Saved")
    right.type_campaign(before.replace("stage", "right"))
    right.wait_to_see("Not saved yet")
    right.press("Save")
    right.wait_to_see("was changed elsewhere")
    texts = [
        (axis_campaign / name).read_text(encoding="utf-8")
        for name in ("removed/campaign.toml", "campaign.toml")
    ]
    assert texts == [before.replace("stage", "left"), before.replace("stage", "right")]
    left.go("/diagnosis")
    right.go("/diagnosis")
    left.press("Run")
    right.wait_to_see("Cancel")
    right.chromium.close()
    left.go("/diagnosis")
    left.wait_to_see("Cancel")
    left.wait_to_see(" left")
    left.chromium.wait("!!document.querySelector('iframe')")
    assert (axis_campaign / "diagnosis" / "report.html").is_file()


def test_a_killed_server_loses_neither_runs_nor_text(
    axis_campaign: Path, serve: Callable[..., Server], window: Window
) -> None:
    server = serve(axis_campaign)
    visitor = window(server)
    visitor.go("/campaign")
    visitor.type_campaign("# typed\n" + (axis_campaign / "campaign.toml").read_text(encoding="utf-8"))
    visitor.wait_to_see("Not saved yet")
    visitor.go("/diagnosis")
    visitor.press("Run")
    visitor.wait_to_see("Cancel")
    server.end(signal.SIGKILL)
    assert len(jobs.running(axis_campaign)) == 1
    again = window(serve(axis_campaign))
    again.go("/campaign")
    assert again.text_of_campaign().startswith("# typed")
    again.go("/diagnosis")
    again.wait_to_see("Cancel")
    again.chromium.wait("!!document.querySelector('iframe')")


def test_a_large_upload_is_not_held_in_memory(
    tmp_path: Path, serve: Callable[..., Server], window: Window
) -> None:
    large = tmp_path / "large.csv"
    with large.open("wb") as file:
        for _ in range(500):
            file.write(b"1.00,2.0\n1.0,2.0\n" * 58823 + b" " * 9)
    server = serve(tmp_path / "campaign")
    first_use.bring(window(server), [large], lambda _: None)
    kept = server.folder / "large.csv"
    assert kept.stat().st_size == large.stat().st_size == 500_000_000
    peak = re.search(r"VmHWM:\s+(\d+) kB", Path(f"/proc/{server.process.pid}/status").read_text())
    assert peak is not None
    assert int(peak[1]) < 400_000
    kept.unlink()
    large.unlink()


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=400k", "tmpfs", str(disk)]
    if shutil.which("mount") is None or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("a small disk can be mounted only as root")
    yield disk
    subprocess.run(["umount", "--lazy", str(disk)], check=True)


def test_a_full_disk_keeps_nothing_half_and_says_so(
    small_disk: Path, serve: Callable[..., Server], window: Window
) -> None:
    (small_disk / "campaign.toml").write_text("title = 'kept'\n", encoding="utf-8")
    server = serve(small_disk)
    code, words = server.ask("PUT", "/upload?name=big.csv", b"1" * 1_000_000)
    assert (code, "the disk is full" in words) == (507, True)
    visitor = window(server)
    visitor.go("/campaign")
    (small_disk / "filler").write_bytes(b"0" * (shutil.disk_usage(small_disk).free))
    visitor.type_campaign("title = 'typed'\n" * 1000)
    visitor.wait_to_see("the disk is full")
    visitor.press("Save")
    visitor.go("/diagnosis")
    visitor.press("Run")
    visitor.wait_to_see("was not started")
    assert sorted(file.name for file in small_disk.iterdir() if file.is_file()) == ["campaign.toml", "filler"]
    assert (small_disk / "campaign.toml").read_text(encoding="utf-8") == "title = 'kept'\n"


def test_nothing_is_written_or_read_outside_of_the_folder(
    tmp_path: Path, serve: Callable[..., Server]
) -> None:
    outer = tmp_path / "outer"
    server = serve(outer / "campaign")
    (outer / "secret").write_text("hidden words")
    assert server.ask("PUT", "/upload?name=..%2F..%2Fx", b"1")[0] == 200
    assert sorted(path.name for path in (*outer.iterdir(), *tmp_path.iterdir())) == [
        "campaign",
        "outer",
        "secret",
    ]
    assert (server.folder / "x").read_bytes() == b"1"
    for path in (
        "/folder/../secret",
        "/folder/..%2fsecret",
        "/folder/%2e%2e/secret",
        f"/folder/{outer}/secret",
        "/file?name=..%2Fsecret",
    ):
        assert "hidden words" not in server.ask("GET", path)[1]
