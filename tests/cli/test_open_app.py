"""What `rigsight app` says where it cannot begin; how it serves is in tests/app."""

from __future__ import annotations

import socket
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., tuple[int, str, str]]


def test_without_the_extra_it_says_what_to_install(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "nicegui", None)
    code, out, err = run("app", tmp_path / "new")
    assert (code, out) == (2, "")
    assert 'pip install "rigsight[app]"' in err
    assert not (tmp_path / "new").exists()


def test_a_port_in_use_and_a_file_for_a_folder_are_refused(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("nicegui", reason="the extra app is not installed")
    (tmp_path / "file").write_text("")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        for arguments in (
            (tmp_path, "--port", port),
            (tmp_path / "file",),
            (tmp_path, "--host", "no.such.host"),
        ):
            code, out, err = run("app", "--no-browser", *arguments)
            assert (code, out) == (2, "")
            assert str(arguments[-1]) in err
