"""Compilers are found, fall back on each other, and leave nothing when they fail or are interrupted."""

from __future__ import annotations

import errno
import os
import signal
import tempfile
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from rigsight.errors import InputError, MachineError
from rigsight.libraries import library_cache as compiling
from rigsight.libraries.library_cache import Compiler, c_compilers, first_library, library

TEXT = {"one.c": '#include "two.h"\nint one(void) { return TWO - 1; }\n', "two.h": "#define TWO 2\n"}
on_posix = pytest.mark.skipif(os.name == "nt", reason="a shell script stands for the compiler")


@pytest.fixture
def temporary(tmp_path, monkeypatch) -> Path:
    """The folder for temporary files, empty."""
    place = tmp_path / "tmp"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    return place


def script(path: Path, body: str) -> Path:
    path.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
    path.chmod(0o755)
    return path


def test_the_same_text_gives_the_same_bytes_and_leaves_nothing_else(temporary):
    used, first = first_library(TEXT, ("-O1",))
    assert first == library(used, TEXT, ("-O1",))
    assert list(temporary.iterdir()) == []


def test_no_compiler_at_all_is_told_with_both_ways_out(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    # The wheel of zig, where it is installed, needs no PATH.
    monkeypatch.setattr(compiling.importlib.util, "find_spec", lambda _: None)
    assert c_compilers() == ()
    with pytest.raises(InputError, match=r"No C compiler was found.*rigsight\[compiler\].*variable CC"):
        first_library(TEXT, ())


def test_a_kept_library_is_used_without_a_compiler(tmp_path, monkeypatch):
    monkeypatch.setenv("RIGSIGHT_CACHE_DIR", str(tmp_path / "kept"))
    text = "int one(void) { return 1; }\n"
    made = compiling.library_file(text)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(compiling.importlib.util, "find_spec", lambda _: None)
    assert compiling.is_kept(text)
    assert compiling.library_file(text) == made
    with pytest.raises(InputError, match="No C compiler was found"):
        compiling.library_file("int two(void) { return 2; }\n")


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ("no-such-compiler -m64", "CC names 'no-such-compiler', which was not found"),
        ("gcc 'half", "CC is not a command"),
    ],
)
def test_a_variable_that_names_no_program_is_told(named: str, message: str, monkeypatch):
    monkeypatch.setenv("CC", named)
    with pytest.raises(InputError, match=message):
        c_compilers()


@on_posix
def test_the_variable_names_a_program_with_options_and_no_other_is_used(tmp_path, monkeypatch):
    own = script(tmp_path / "own-cc", "exit 0")
    monkeypatch.setenv("CC", f"{own} -m64 '-DA B'")
    (found,) = c_compilers()
    assert found.command == (str(own), "-m64", "-DA B")


@on_posix
def test_a_compiler_that_fails_is_followed_by_the_next_one_unless_it_was_named(tmp_path, monkeypatch):
    sound = c_compilers()[0]
    broken = script(tmp_path / "cc", "echo 'one.c:1: fatal error: no room in the house' >&2; exit 1")
    both = (Compiler((str(broken),), "broken"), sound)
    monkeypatch.setattr(compiling, "c_compilers", lambda: both)
    used, content = first_library(TEXT, ())
    assert used == sound
    assert content == library(sound, TEXT, ())
    monkeypatch.undo()
    monkeypatch.setenv("CC", str(broken))
    with pytest.raises(MachineError, match=r"cc failed: .*no room in the house.*variable CC"):
        first_library(TEXT, ())


@on_posix
def test_a_compiler_that_says_nothing_or_makes_nothing_has_failed(tmp_path, temporary):
    for body in ("exit 1", "exit 0"):
        silent = Compiler((str(script(tmp_path / "cc", body)),), "silent")
        with pytest.raises(MachineError, match="failed: no message"):
            library(silent, TEXT, ())
    assert list(temporary.iterdir()) == []


@on_posix
def test_a_full_disk_is_told_and_no_compiler_blamed(tmp_path, monkeypatch):
    failing = Compiler((str(script(tmp_path / "cc", "exit 1")),), "failing")
    full = SimpleNamespace(total=10**9, used=10**9, free=0)
    monkeypatch.setattr(compiling.shutil, "disk_usage", lambda _: full)
    with pytest.raises(MachineError, match=f"{os.strerror(errno.ENOSPC)}.*TMPDIR"):
        library(failing, TEXT, ())


def test_a_program_that_cannot_be_started_is_told(tmp_path):
    with pytest.raises(MachineError, match="cannot be run"):
        library(Compiler((str(tmp_path / "gone"),), "gone"), TEXT, ())


@on_posix
def test_an_interrupted_compiler_leaves_no_file_and_no_helper(tmp_path, temporary):
    mark = tmp_path / "mark"
    slow = script(tmp_path / "cc", f'echo > "$TMPDIR/part.s"\nsleep 60 & echo $! > {mark}\nwait')

    def interrupt() -> None:
        while not (mark.exists() and mark.read_text()):
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        library(Compiler((str(slow),), "slow"), TEXT, ())
    thread.join()
    assert list(temporary.iterdir()) == []
    helper = Path("/proc") / mark.read_text().strip() / "stat"

    def alive() -> bool:
        try:
            return helper.read_text().rpartition(")")[2].split()[0] != "Z"
        except OSError:
            return False

    # A killed process takes a moment to end on a busy machine; one that was not killed would sleep for a minute.
    end = time.monotonic() + 30.0
    while alive() and time.monotonic() < end:
        time.sleep(0.01)
    assert not alive()
