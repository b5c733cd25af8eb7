"""Display of progress on the terminal."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import IO, Any, cast

import typer

from rigsight.workflow.run.progress import Listener, Step, silent

_REMEMBERED = 24 * 3600.0
"""Time [s] over which the speed of steps is averaged."""
_BETWEEN_LINES = 30.0
"""Interval [s] of progress lines in a log."""


@contextlib.contextmanager
def listening(quiet: bool) -> Iterator[Listener]:
    """Show progress on stderr: a bar on a terminal, a line at intervals in a log, nothing if quiet."""
    # A process without a terminal may have no stderr at all.
    if quiet or sys.stderr is None:
        yield silent
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
            typer.echo(line, err=True)

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
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[detail]}"),
    )
    # Single steps take minutes, so the remaining time is estimated from all of them.
    with Progress(
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
