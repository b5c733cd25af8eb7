"""Progress of a command: finished steps out of a known number, passed to a listener, and their display on a terminal."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import IO, Any, cast

_REMEMBERED = 24 * 3600.0
"""Time [s] over which the speed of steps is averaged."""
_BETWEEN_LINES = 30.0
"""Interval [s] of progress lines in a log."""
PROGRESS_VARIABLE, JSON_LINES = "RIGSIGHT_PROGRESS", "json"
"""Environment variable and its value with which every step is a line of JSON on stderr, for other programs."""


@dataclass(frozen=True)
class Step:
    """One finished step."""

    stage: str  # what is being done
    detail: str  # what has just been finished; empty at the start of a stage
    # Steps of the stage that are finished, and all of them; both 0 for a remark.
    done: int
    total: int


Listener = Callable[[Step], None]


def silent(step: Step) -> None:
    """Ignore a step."""


def report_notes(remarks: Iterable[str], listener: Listener) -> None:
    """Pass a note to a listener early, while the user can still stop."""
    for remark in remarks:
        listener(Step(remark, "", 0, 0))


class Stage:
    """Counts the steps of one stage and reports them to a listener; more steps than announced raise the total."""

    def __init__(self, name: str, total: int, listener: Listener) -> None:
        self._name = name
        self._total = total
        self._listener = listener
        self._done = 0
        if total:  # A step of none would be a remark.
            listener(Step(name, "", 0, total))

    def finished(self, detail: str) -> None:
        """Report one more finished step."""
        self._done += 1
        self._total = max(self._total, self._done)
        self._listener(Step(self._name, detail, self._done, self._total))


@contextlib.contextmanager
def listening(quiet: bool) -> Iterator[Listener]:
    """Show progress on stderr: a bar on a terminal, a line at intervals in a log, JSON where asked for, nothing if quiet."""
    # A process without a terminal may have no stderr at all.
    if quiet or sys.stderr is None:
        yield silent
    elif os.environ.get(PROGRESS_VARIABLE) == JSON_LINES:
        yield json_lines()
    elif not sys.stderr.isatty():
        yield log_lines()
    else:
        with _bar() as listener:
            yield listener


def log_lines(between: float = _BETWEEN_LINES, clock: Callable[[], float] = time.monotonic) -> Listener:
    """Return a listener that prints a line at the start of a stage, and later at most one line per interval."""
    last = clock()

    def say(step: Step) -> None:
        nonlocal last
        if step.done > 0 and clock() - last < between:
            return
        last = clock()
        detail = f": {step.detail}" if step.detail else ""
        line = f"{step.stage} ({step.done} of {step.total}){detail}" if step.done > 0 else f"{step.stage} ..."
        if step.total == 0:
            line = f"Note: {step.stage}"
        # A full disk or a closed terminal must not end hours of work.
        with contextlib.suppress(OSError):
            sys.stderr.write(f"{line}\n")

    return say


def json_lines() -> Listener:
    """Return a listener that prints every step as a line of JSON, with the time [s] since it was made."""
    begun = time.monotonic()

    def say(step: Step) -> None:
        with contextlib.suppress(OSError):
            sys.stderr.write(json.dumps({**vars(step), "seconds": round(time.monotonic() - begun, 3)}) + "\n")

    return say


class _Lasting:
    """A terminal that may be closed: output that can no longer be shown neither ends the work nor hides an error."""

    def __init__(self, terminal: IO[str]) -> None:
        self._terminal = terminal

    def __getattr__(self, name: str) -> Any:
        return getattr(self._terminal, name)

    def write(self, text: str, /) -> int:
        with contextlib.suppress(OSError):
            return self._terminal.write(text)
        return len(text)

    def flush(self) -> None:
        with contextlib.suppress(OSError):
            self._terminal.flush()


@contextlib.contextmanager
def _bar() -> Iterator[Listener]:
    from rich import progress as bar
    from rich.console import Console

    columns = (
        bar.TextColumn("{task.description}"),
        bar.BarColumn(),
        bar.MofNCompleteColumn(),
        bar.TimeElapsedColumn(),
        bar.TextColumn("left"),
        bar.TimeRemainingColumn(),
        bar.TextColumn("{task.fields[detail]}"),
    )
    # Single steps take minutes, so the remaining time is estimated from all of them.
    with bar.Progress(
        *columns,
        console=Console(file=cast("IO[str]", _Lasting(sys.stderr)), force_terminal=True),
        transient=True,
        speed_estimate_period=_REMEMBERED,
    ) as progress:
        tasks = {}
        # Importing sympy and scipy takes the first seconds: show that something happens.
        starting = progress.add_task("Starting", total=None, detail="")

        def listener(step: Step) -> None:
            if step.total == 0:
                progress.console.print(f"Note: {step.stage}", highlight=False, markup=False)
                return
            progress.update(starting, visible=False)
            if step.stage not in tasks:
                tasks[step.stage] = progress.add_task(step.stage, total=step.total, detail="")
            progress.update(tasks[step.stage], completed=step.done, total=step.total, detail=step.detail)

        yield listener
