"""A command line that is run in the process of the test."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import pytest

from rigsight import cli

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """Run a command line in this process and return exit code, stdout and stderr."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["rigsight", *map(str, arguments)])
        capfd.readouterr()
        try:
            cli.command_line()
            code: Any = 0
        except SystemExit as leaving:
            code = leaving.code or 0
        return code, *capfd.readouterr()

    return call
