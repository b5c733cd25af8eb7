"""Commands that run in the folder of a campaign: started, found again by any server, canceled; all of it stands on disk."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigsight.app.job_process import EXIT
from rigsight.app.workspace import FULL, OWN
from rigsight.errors import InputError, MachineError
from rigsight.workflow.run.progress import JSON_LINES, PROGRESS_VARIABLE

_JOB = "job.json"
_CLOCKS = 2.0
"""Largest difference [s] between two readings of when a process began."""
_MOST_SHOWN = 2_000_000
"""Of an output, in bytes."""
CANCELED = (130, -signal.SIGINT)


@dataclass(frozen=True)
class Progress:
    """The last step of the current stage, and the time that it will still take at the speed so far."""

    text: str
    share: float  # of the stage, 0 to 1
    seconds_left: float | None


@dataclass(frozen=True)
class Job:
    """One command as it is now."""

    folder: Path
    arguments: tuple[str, ...]  # after `rigsight`
    started: float  # [s] since 1970
    pid: int
    created: float  # when its process began, so that a later process of the same number is not taken for it

    @property
    def exit_code(self) -> int | None:
        """None while it runs, and for a command that was killed."""
        try:
            return int((self.folder / EXIT).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None

    @property
    def is_running(self) -> bool:
        """Whether it has not ended, whichever server started it."""
        import psutil

        if self.exit_code is not None:
            return False
        try:
            process = psutil.Process(self.pid)
            alike = abs(process.create_time() - self.created) < _CLOCKS
            return bool(alike and process.status() != psutil.STATUS_ZOMBIE)
        except psutil.Error:
            return False

    @property
    def output(self) -> str:
        """What it printed on stdout."""
        return _text(self.folder / "stdout")

    def messages(self) -> list[str]:
        """Return what it printed on stderr beside its progress: notes, and why it ended."""
        steps, others = _split(_text(self.folder / "stderr"))
        return [*dict.fromkeys(step["stage"] for step in steps if not step["total"]), *others]

    def progress(self) -> Progress | None:
        """Return how far it is; None before its first step."""
        steps = [step for step in _split(_text(self.folder / "stderr"))[0] if step["total"]]
        if not steps:
            return None
        last = steps[-1]
        begun = next(step["seconds"] for step in steps if step["stage"] == last["stage"])
        left = None
        if last["done"]:
            left = (time.time() - self.created - begun) / last["done"] * (last["total"] - last["done"])
        detail = f": {last['detail']}" if last["detail"] else ""
        text = f"{last['stage']} ({last['done']} of {last['total']}){detail}"
        return Progress(text, last["done"] / last["total"], left)

    def cancel(self) -> None:
        """Interrupt it as Ctrl-C would; it ends once it has cleaned up."""
        import psutil

        if not self.is_running:
            return
        if os.name == "posix":
            os.killpg(self.pid, signal.SIGINT)
        else:
            for child in psutil.Process(self.pid).children():
                child.terminate()


def shown(arguments: Sequence[str]) -> str:
    """Return a command as it is typed."""
    return shlex.join(("rigsight", *arguments))


def start(root: Path, name: str, arguments: Sequence[str]) -> Job:
    """Start a command in a folder; its earlier run of this name is forgotten."""
    earlier = find(root, name)
    if earlier is not None and earlier.is_running:
        raise InputError(
            f"{shown(earlier.arguments)} is running already, perhaps in another window. Cancel it first."
        )
    try:
        return _started(root / OWN / "jobs" / name, root, arguments)
    except OSError as error:
        why = "the disk is full" if error.errno in FULL else error.strerror
        raise MachineError(
            f"{shown(arguments)} was not started: {why}. Free disk space, then run it again."
        ) from None


def _started(folder: Path, root: Path, arguments: Sequence[str]) -> Job:
    import psutil

    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    process = subprocess.Popen(
        [sys.executable, "-m", "rigsight.app.job_process", str(folder), sys.executable, "-m", "rigsight", *arguments],
        cwd=root, env={**os.environ, PROGRESS_VARIABLE: JSON_LINES, "COLUMNS": "100"}, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    job = Job(folder, tuple(arguments), time.time(), process.pid, psutil.Process(process.pid).create_time())
    content = {"arguments": job.arguments, "started": job.started, "pid": job.pid, "created": job.created}
    part = folder / f"{_JOB}.part"
    part.write_text(json.dumps({"schema_version": 1, **content}, indent=2), encoding="utf-8")
    part.replace(folder / _JOB)
    return job


def find(root: Path, name: str) -> Job | None:
    """Return the last run of this name in a folder; None if there was none."""
    folder = root / OWN / "jobs" / name
    try:
        read = json.loads((folder / _JOB).read_text(encoding="utf-8"))
        return Job(folder, tuple(read["arguments"]), read["started"], read["pid"], read["created"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def running(root: Path) -> list[Job]:
    """Return the commands that run in a folder now."""
    jobs = [find(root, folder.name) for folder in sorted((root / OWN / "jobs").glob("*"))]
    return [job for job in jobs if job is not None and job.is_running]


def _text(file: Path) -> str:
    try:
        with file.open("rb") as stream:
            return stream.read(_MOST_SHOWN).decode("utf-8", "replace")
    except OSError:
        return ""


def _split(stderr: str) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the steps and the other lines; the last line may not be whole yet."""
    steps: list[dict[str, Any]] = []
    others = []
    for line in stderr.splitlines():
        if line.startswith('{"stage"'):
            try:
                steps.append(json.loads(line))
            except ValueError:
                continue
        elif line.strip():
            others.append(line)
    return steps, others
